"""Claims about the simulated cloth."""

import math

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.errors import InvalidInputError, SimulationError

SMALL = ClothConfig(vertices=(15, 15))


def tool_at(x: float, y: float, z: float = 0.0015) -> np.ndarray:
    """A tool frame at a point, axes as the table's."""
    transform = np.eye(4)
    transform[:3, 3] = (x, y, z)
    return transform


def awake(config: ClothConfig, height: float | None = None) -> Cloth:
    """A flat cloth that does not sleep yet, at a height of its mid-surface."""
    positions = Cloth(config).positions_in_table
    positions[:, 2] = height if height is not None else positions[:, 2]
    return Cloth.from_positions(positions, config)


def test_held_point_stays_at_the_hand() -> None:
    """A vertex that a hand holds is where the hand is, while the rest hangs from it."""
    cloth = Cloth(SMALL)
    assert cloth.grasp(0, tool_at(-0.2, -0.2)) == 1
    for step in range(60):
        cloth.move_hand(0, tool_at(-0.2, -0.2, 0.0015 + 0.2 * (step + 1) / 60))
        cloth.advance(SMALL.step)
    cloth.advance(0.3)
    np.testing.assert_allclose(cloth.positions_in_table[0], [-0.2, -0.2, 0.2015], atol=1e-3)
    assert cloth.positions_in_table[:, 2].min() == pytest.approx(0.0015)


def test_hand_turns_what_it_holds() -> None:
    """Held vertices keep their places in the tool frame when it turns."""
    # A strong grip: turning the whole cloth on the desk takes more than the default.
    config = ClothConfig(vertices=(15, 15), grasp_radius=0.035, grip_force=20.0, press_force=20.0)
    cloth = Cloth(config)
    assert cloth.grasp(0, tool_at(0.0, 0.0)) == 5
    held = np.flatnonzero(np.linalg.norm(cloth.positions_in_table[:, :2], axis=1) < 0.035)
    before = cloth.positions_in_table[held]
    for step in range(1, 61):
        angle = math.pi / 2 * step / 60
        transform = tool_at(0.0, 0.0, 0.0015 + 0.1 * step / 60)
        transform[:2, :2] = [
            [math.cos(angle), -math.sin(angle)],
            [math.sin(angle), math.cos(angle)],
        ]
        cloth.move_hand(0, transform)
        cloth.advance(config.step)
    cloth.advance(0.5)
    wanted = np.stack([-before[:, 1], before[:, 0], before[:, 2] + 0.1], axis=1)
    np.testing.assert_allclose(cloth.positions_in_table[held], wanted, atol=2e-3)


def test_energy_does_not_grow() -> None:
    """Without damping an arched sheet that falls never has more energy than at its start."""
    config = ClothConfig(vertices=(15, 15), damping=0.0)
    positions = Cloth(config).positions_in_table
    # An arch whose chords keep the edges' length, so that nothing is stretched.
    angle = np.radians(6.0)
    radius = 0.5 * config.spacing[0] / math.sin(0.5 * angle)
    turned = angle * positions[:, 0] / config.spacing[0]
    positions[:, 2] = 0.05 + radius * (np.cos(turned) - np.cos(turned).min())
    positions[:, 0] = radius * np.sin(turned)
    cloth = Cloth.from_positions(positions, config)
    start = 9.81 * cloth.positions_in_table[:, 2].mean()
    for _ in range(120):
        cloth.advance(config.step)
        kinetic = 0.5 * (cloth.velocities**2).sum(axis=1).mean()
        assert kinetic + 9.81 * cloth.positions_in_table[:, 2].mean() < 1.001 * start
    assert kinetic < 0.05 * start


@pytest.mark.parametrize(("slope", "slides"), [(0.4, False), (0.6, True)])
def test_friction_holds_below_its_angle(slope: float, slides: bool) -> None:
    """On a desk with friction 0.5 the cloth holds at a slope of 0.4 and slides at 0.6."""
    angle = math.atan(slope)
    gravity = (9.81 * math.sin(angle), 0.0, -9.81 * math.cos(angle))
    config = ClothConfig(vertices=(15, 15), desk_friction=0.5, gravity=gravity, damping=0.0)
    cloth = awake(config)
    cloth.advance(0.4)
    way = cloth.positions_in_table[:, 0].mean()
    # A block would slide by g (sin - mu cos) t^2 / 2.
    expected = 0.5 * 9.81 * (math.sin(angle) - 0.5 * math.cos(angle)) * 0.4**2 if slides else 0.0
    assert way == pytest.approx(expected, abs=1e-3 + 0.05 * expected)


def test_nothing_sinks_into_the_desk() -> None:
    """A cloth dropped onto the desk stops half a thickness above it."""
    cloth = awake(SMALL, height=0.05)
    for _ in range(100):
        cloth.advance(SMALL.step)
        assert cloth.positions_in_table[:, 2].min() >= 0.5 * SMALL.thickness - 1e-12
    assert cloth.settled
    np.testing.assert_allclose(cloth.positions_in_table[:, 2], 0.0015, atol=1e-4)


def test_same_calls_give_identical_bits() -> None:
    """Two clothes treated alike are equal to the last bit."""
    results = []
    for _ in range(2):
        cloth = Cloth(SMALL)
        cloth.grasp(0, tool_at(0.2, 0.2))
        cloth.move_hand(0, tool_at(0.0, 0.1, 0.1))
        cloth.advance(0.3)
        cloth.release(0)
        cloth.advance(0.2)
        results.append(cloth.positions_in_table)
    assert np.array_equal(results[0], results[1])


def test_resting_cloth_sleeps_until_grasped() -> None:
    """A day at rest passes at once and changes nothing; a grasp wakes the cloth."""
    cloth = Cloth(SMALL)
    before = cloth.positions_in_table
    cloth.advance(86400.0)
    assert cloth.settled and np.array_equal(cloth.positions_in_table, before)
    cloth.grasp(0, tool_at(0.2, 0.2))
    assert not cloth.settled


def test_grasp_beside_the_cloth_holds_nothing() -> None:
    """A hand closing 5 cm beside or above the cloth holds nothing and does not wake it."""
    cloth = Cloth(SMALL)
    before = cloth.positions_in_table
    assert cloth.grasp(0, tool_at(0.25, 0.0)) == 0
    assert cloth.grasp(1, tool_at(0.0, 0.0, 0.06)) == 0
    cloth.move_hand(0, tool_at(0.0, 0.0))
    cloth.advance(0.5)
    assert np.array_equal(cloth.positions_in_table, before)


def test_grasp_takes_all_layers_at_its_spot_only() -> None:
    """A hand takes both layers of a folded cloth, and nothing farther than its reach."""
    positions = Cloth(SMALL).positions_in_table
    far = positions[:, 0] < -1e-9
    positions[far, 0] *= -1
    positions[far, 2] += 0.003
    cloth = Cloth.from_positions(positions, SMALL)
    assert cloth.grasp(0, tool_at(0.2, 0.2)) == 2
    assert cloth.held_count(0) == 2
    assert cloth.grasp(1, tool_at(0.2, 0.2)) == 0, "the other hand's vertices are taken"


def test_check_finds_layers_that_cross() -> None:
    """A sheet whose folded half dives through the lower one is reported, a clean fold is not."""
    positions = Cloth(SMALL).positions_in_table
    far = positions[:, 0] < -1e-9
    positions[far, 0] *= -1
    clean, crossed = positions.copy(), positions.copy()
    clean[far, 2] += 0.003
    crossed[:, 2] += 0.05
    crossed[far, 2] += 0.2 * (crossed[far, 0] - 0.1)
    # A slight turn keeps vertices of one layer off the edges of the other.
    crossed[far, 1] += 0.007
    assert Cloth.from_positions(clean, SMALL).check().crossings == 0
    cloth = Cloth.from_positions(crossed, SMALL)
    assert cloth.check().crossings > 8
    with pytest.raises(SimulationError):
        cloth.check(raise_on_failure=True)


def test_check_finds_stretch() -> None:
    """A sheet drawn out by a tenth along x fails the check with the right figure."""
    positions = Cloth(SMALL).positions_in_table * np.array([1.1, 1.0, 1.0])
    result = Cloth.from_positions(positions, SMALL).check()
    assert result.worst_stretch == pytest.approx(1.1) and "stretch" in result.failure


@pytest.mark.parametrize(
    "call",
    [
        lambda cloth: cloth.advance(0.0),
        lambda cloth: cloth.advance(float("nan")),
        lambda cloth: cloth.grasp(2, np.eye(4)),
        lambda cloth: cloth.grasp(0, np.eye(3)),
        lambda cloth: cloth.move_hand(0, 2.0 * np.eye(4)),
        lambda cloth: Cloth.from_positions(np.zeros((4, 3)), SMALL),
        lambda cloth: Cloth.from_positions(np.full((225, 3), np.nan), SMALL),
    ],
)
def test_bad_calls_are_rejected(call) -> None:  # noqa: ANN001
    """Arguments without sense raise InvalidInputError."""
    with pytest.raises(InvalidInputError):
        call(Cloth(SMALL))
