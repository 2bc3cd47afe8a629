"""Claims about bending by hinges with a rest angle."""

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.hinges import cell_hinges, hinge_angles, turn_hinges
from emd_cloth_sim.mesh import flat_positions

SIDE = 9
HINGES = cell_hinges((SIDE, SIDE))


def bent_sheet(radius: float, axis: int = 0) -> np.ndarray:
    """A sheet of 0.1 m rolled up about the other axis."""
    flat = flat_positions((SIDE, SIDE), (0.1, 0.1))
    angle = flat[:, axis] / radius
    flat[:, 2] = radius * np.cos(angle)
    flat[:, axis] = radius * np.sin(angle)
    return flat


def push(position: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Accelerations of a sheet whose hinges have the given rest angles."""
    acceleration = np.empty_like(position)
    turn_hinges(position, HINGES, rest, np.ones(len(HINGES)), 1.0, acceleration)
    return acceleration


@pytest.mark.parametrize("axis", [0, 1])
def test_angles_measure_the_curvature(axis: int) -> None:
    """A rolled sheet's hinges turn by spacing over radius about one axis, not about the other."""
    angles = hinge_angles(bent_sheet(0.1, axis), HINGES)
    bent, straight = np.array_split(angles, 2)[:: 1 if axis == 0 else -1]
    np.testing.assert_allclose(np.abs(bent), 0.1 / (SIDE - 1) / 0.1, rtol=1e-6)
    assert len(set(np.sign(bent))) == 1
    np.testing.assert_allclose(straight, 0.0, atol=1e-9)


def test_bending_pushes_towards_flat_without_net_force() -> None:
    """A rolled sheet's rim is driven back to the plane, and the forces add up to nothing."""
    position = bent_sheet(0.1)
    acceleration = push(position, np.zeros(len(HINGES)))
    np.testing.assert_allclose(acceleration.sum(axis=0), 0.0, atol=1e-12)
    rim = acceleration.reshape(SIDE, SIDE, 3)[[0, -1]]
    assert (rim[..., 2] > 0.0).all()


def test_own_shape_as_rest_shape_is_at_rest() -> None:
    """A sheet whose rest angles are its own feels no bending."""
    position = bent_sheet(0.03)
    np.testing.assert_allclose(push(position, hinge_angles(position, HINGES)), 0.0, atol=1e-12)


def test_cantilever_sags_as_its_rigidity_says() -> None:
    """The clamped strip's tip sinks by weight times length^4 over 8 rigidities (beam theory)."""
    rigidity, density, spacing = 2e-4, 0.35, 0.00625
    config = ClothConfig(
        side_lengths=(14 * spacing, 4 * spacing),
        vertices=(15, 5),
        areal_density=density,
        bending="hinges",
        bending_rigidity=rigidity,
        membrane="springs",
        stretch_compliance=1e-3,
        shear_compliance=1e-3,
        internal_damping=0.01,
        sharpest_fold=0.0,
        damping=8.0,
        rigid_grip=True,
        grasp_radius=0.5,
    )
    flat = flat_positions(config.vertices, config.side_lengths) + [0.0, 0.0, 0.1]
    cloth = Cloth.from_positions(flat, config)
    hand = np.diag([1.0, -1.0, -1.0, 1.0])
    hand[:3, 3] = [flat[0, 0] + 2.5 * spacing - 0.5, 0.0, 0.1]
    assert cloth.grasp(0, hand) == 3 * 5, "the clamp holds three rows"
    cloth.move_hand(0, hand)
    cloth.advance(1.5)
    assert cloth.max_speed < 1e-2
    sag = 0.1 - cloth.positions_in_table.reshape(15, 5, 3)[-1, :, 2].mean()
    # A vertex weighs as much as the cell that it stands for.
    weight = config.vertex_mass / spacing**2 * 9.81
    length = 12 * spacing
    beam = weight * length**4 / (8.0 * rigidity)
    assert sag == pytest.approx(beam, rel=0.15)
