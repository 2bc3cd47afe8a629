"""Claims about the cloth's mechanics, against formulas and other integrators."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig

HIGH = 0.5


def tool_at(x: float, y: float, z: float) -> np.ndarray:
    """A tool frame at a point, axes as the table's."""
    transform = np.eye(4)
    transform[:3, 3] = (x, y, z)
    return transform


def hung(config: ClothConfig) -> Cloth:
    """A flat cloth far above the desk."""
    positions = Cloth(config).positions_in_table
    positions[:, 2] = HIGH
    return Cloth.from_positions(positions, config)


def elastica_drop(length: float, load: float, rigidity: float) -> float:
    """How far the end of a clamped heavy strip hangs below its root, metres.

    Solves B theta'' = -w (L - s) cos(theta) for the angle below the horizontal, with no angle at
    the root and no moment at the end; `load` w in N/m^2 and `rigidity` B in N m of a unit width.
    """
    s = np.linspace(0.0, length, 101)
    solution = solve_bvp(
        lambda s, y: np.stack([y[1], -load * (length - s) * np.cos(y[0]) / rigidity]),
        lambda root, end: np.array([root[0], end[1]]),
        s,
        np.stack([s / length, np.ones_like(s) / length]),
    )
    return float(np.trapezoid(np.sin(solution.sol(s)[0]), s))


def test_strip_hangs_as_a_catenary() -> None:
    """A limp strip held at both ends hangs as deep as a chain of its length."""
    config = ClothConfig(
        side_lengths=(0.4, 0.02), vertices=(81, 5), bending_rigidity=1e-8, grip_force=50.0
    )
    cloth = hung(config)
    for hand, x in ((0, -0.2), (1, 0.2)):
        assert cloth.grasp(hand, tool_at(x, 0.0, HIGH)) > 0
    for step in range(1, 61):
        for hand, x in ((0, -0.2), (1, 0.2)):
            cloth.move_hand(hand, tool_at(x * (1.0 - 0.25 * step / 60), 0.0, HIGH))
        cloth.advance(config.step)
    cloth.advance(1.2)
    grid = cloth.positions_in_table.reshape(81, 5, 3)
    # Each hand also holds the next row, so a spacing less hangs at either end.
    span, length = 0.3 - 2 * 0.005, 0.4 - 2 * 0.005
    a = brentq(lambda a: 2 * a * math.sinh(span / (2 * a)) - length, 0.03, 1.0)
    sag = a * (math.cosh(span / (2 * a)) - 1.0)
    assert HIGH - grid[40, 2, 2] == pytest.approx(sag, rel=0.02)
    quarter = a * (math.cosh(span / (2 * a)) - math.cosh(0.5 * span / (2 * a)))
    depth = np.interp(-0.25 * span, grid[:41, 2, 0], HIGH - grid[:41, 2, 2])
    assert depth == pytest.approx(quarter, rel=0.03)


@pytest.mark.parametrize("vertices", [(49, 9), (49, 5)])
@pytest.mark.parametrize("rigidity", [pytest.param(2e-5, marks=pytest.mark.slow), 1e-4])
def test_cantilever_bends_as_its_stiffness_says(
    rigidity: float, vertices: tuple[int, int]
) -> None:
    """A clamped strip hangs as deep as the heavy elastica, whatever the shape of its cells.

    The mesh puts whole mass and stiffness on its rims where half would be right, so the strip
    counts as one spacing wider and longer; the clamp ends at the second row.
    """
    config = ClothConfig(
        side_lengths=(0.12, 0.02),
        vertices=vertices,
        bending_rigidity=rigidity,
        shear_compliance=1.0,
        grip_force=100.0,
        press_force=100.0,
        grasp_radius=0.0127,
        damping=8.0,
    )
    cloth = hung(config)
    # Outside the strip, so that the reach covers just two whole rows.
    centre = -0.06 - 0.0085 + 0.0025
    reach = np.hypot(*(cloth.positions_in_table[:, :2] - (centre, 0.0)).T) <= 0.0127
    assert cloth.grasp(0, tool_at(centre, 0.0, HIGH)) == reach.sum() > 0
    clamped = reach.reshape(vertices).all(axis=1).sum()
    cloth.advance(1.5)
    free = 0.0025 * (vertices[0] - clamped)
    mass_share = (vertices[0] - 1) / vertices[0] * (vertices[1] - 1) / vertices[1]
    stiff_share = vertices[1] / (vertices[1] - 1) * (vertices[1] - 1) / vertices[1]
    drop = elastica_drop(free, 0.35 * 9.81 * mass_share, rigidity * stiff_share)
    tip = cloth.positions_in_table.reshape(*vertices, 3)[-1, vertices[1] // 2, 2]
    assert HIGH - tip == pytest.approx(drop, rel=0.08)


def test_momentum_is_kept_without_contact() -> None:
    """A stretched sheet in free space springs back without moving or turning as a whole."""
    config = ClothConfig(vertices=(21, 21), gravity=(0.0, 0.0, 0.0), damping=0.0)
    positions = hung(config).positions_in_table
    positions[:, :2] *= (1.002, 1.001)
    positions[:, 2] += 0.002 * np.sin(20.0 * positions[:, 0])
    cloth = Cloth.from_positions(positions, config)
    centre, peak = positions.mean(axis=0), 0.0
    for _ in range(24):
        cloth.advance(config.step)
        now, velocity = cloth.positions_in_table, cloth.velocities
        peak = max(peak, np.linalg.norm(velocity, axis=1).mean())
        # Single precision: a hundredth of what the vertices travel meanwhile.
        np.testing.assert_allclose(now.mean(axis=0), centre, atol=4e-5)
        assert np.linalg.norm(velocity.mean(axis=0)) < 3e-3 * peak
        turning = np.cross(now - centre, velocity).mean(axis=0)
        assert np.linalg.norm(turning) < 3e-3 * peak * 0.2
    assert peak > 0.01


def test_free_fall_is_uniform() -> None:
    """Without air and desk a sheet falls g t^2 / 2 and stays flat."""
    config = ClothConfig(vertices=(21, 21), damping=0.0)
    cloth = hung(config)
    cloth.advance(0.2)
    heights = cloth.positions_in_table[:, 2]
    assert np.ptp(heights) < 1e-5
    assert HIGH - heights.mean() == pytest.approx(0.5 * 9.81 * 0.2**2, rel=2e-3)


def test_pinned_point_stays() -> None:
    """A vertex held still by a strong grip does not move while the cloth swings from it."""
    config = ClothConfig(vertices=(21, 21), grip_force=20.0, press_force=20.0)
    cloth = hung(config)
    assert cloth.grasp(0, tool_at(-0.2, -0.2, HIGH)) == 1
    for _ in range(60):
        cloth.advance(config.step)
        np.testing.assert_allclose(cloth.positions_in_table[0], [-0.2, -0.2, HIGH], atol=2e-3)


def test_grip_slips_instead_of_tearing() -> None:
    """Cloth held by both hands that part beyond its length is not stretched by more than 5 %."""
    config = ClothConfig(vertices=(21, 21))
    cloth = hung(config)
    for hand, y in ((0, -0.2), (1, 0.2)):
        cloth.grasp(hand, tool_at(0.0, y, HIGH))
    for step in range(1, 121):
        for hand, y in ((0, -0.2), (1, 0.2)):
            cloth.move_hand(hand, tool_at(0.0, y * (1.0 + step / 120), HIGH))
        cloth.advance(config.step)
    assert cloth.check().stretch_p99 < 1.05


@pytest.mark.parametrize(("friction", "slides"), [(0.6, False), (0.3, True)])
def test_layers_stick_below_the_angle_of_friction(friction: float, slides: bool) -> None:
    """On a slope of 0.45 a layer holds on another one with friction 0.6, with 0.3 it slides."""
    angle = math.atan(0.45)
    gravity = (9.81 * math.sin(angle), 0.0, -9.81 * math.cos(angle))
    config = ClothConfig(
        vertices=(41, 11),
        side_lengths=(0.4, 0.1),
        gravity=gravity,
        cloth_friction=friction,
        desk_friction=5.0,
        damping=0.0,
    )
    positions = Cloth(config).positions_in_table.reshape(41, 11, 3)
    # Folded about x = 0, the upper half open on the downhill side.
    positions[:20, :, 0] *= -1.0
    positions[:20, :, 2] += config.thickness
    cloth = Cloth.from_positions(positions.reshape(-1, 3), config)
    cloth.advance(0.15)
    way = (
        cloth.positions_in_table.reshape(41, 11, 3)[:15, :, 0].mean() - positions[:15, :, 0].mean()
    )
    assert (way > 2e-3) == slides
