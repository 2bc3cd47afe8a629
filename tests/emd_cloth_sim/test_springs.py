"""Claims about the damped springs of the reference cloth."""

import numpy as np
import pytest

from emd_cloth_sim.springs import hold_damped_lengths

PAIR = np.array([[0, 1]], dtype=np.int32)
SUBSTEP = 1e-3


def sweep(
    position: np.ndarray,
    previous: np.ndarray,
    mobility: tuple[float, float] = (1.0, 1.0),
    stretch: float = 0.0,
    squeeze: float = 0.0,
    damping: float = 0.0,
    sweeps: int = 1,
    limit: float = 1e30,
    shortest: float = 0.0,
) -> np.ndarray:
    """Hold two vertices a length of 1 apart; gives the new positions."""
    moved = position.copy()
    multipliers = np.zeros(1)
    for _ in range(sweeps):
        hold_damped_lengths(
            moved,
            previous,
            np.array(mobility),
            PAIR,
            np.ones(1),
            multipliers,
            stretch,
            squeeze,
            damping,
            limit,
            shortest,
        )
    return moved


def ends(length: float) -> np.ndarray:
    """Two vertices so far apart along x."""
    return np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])


@pytest.mark.parametrize("length", [0.7, 1.4])
def test_free_springs_keep_momentum(length: float) -> None:
    """A spring between free vertices moves them against each other, not their middle."""
    start = ends(length)
    moved = sweep(start, start, stretch=0.5, squeeze=0.3, damping=2.0)
    np.testing.assert_allclose(moved.mean(axis=0), start.mean(axis=0), atol=1e-12)
    assert abs(moved[1, 0] - moved[0, 0] - 1.0) < abs(length - 1.0)


def test_slack_springs_only_pull() -> None:
    """A spring without resistance to squeezing leaves shortened pairs alone."""
    np.testing.assert_array_equal(sweep(ends(0.7), ends(0.7), squeeze=-1.0), ends(0.7))
    assert sweep(ends(1.3), ends(1.3), squeeze=-1.0)[1, 0] < 1.3


@pytest.mark.parametrize(("length", "wanted"), [(1.4, 1.06), (1.05, 1.05), (0.7, 0.7), (0.3, 0.5)])
def test_soft_springs_end_at_their_limits(length: float, wanted: float) -> None:
    """However soft, a spring gets no longer and no shorter than its limits."""
    moved = sweep(ends(length), ends(length), stretch=1e6, squeeze=1e6, limit=1.06, shortest=0.5)
    assert moved[1, 0] - moved[0, 0] == pytest.approx(wanted, abs=1e-5)


def test_rigid_grip_does_not_yield() -> None:
    """A vertex without mobility stays, and the other one does all the moving."""
    moved = sweep(ends(1.5), ends(1.5), mobility=(0.0, 1.0))
    np.testing.assert_allclose(moved, ends(1.0), atol=1e-12)


def test_weight_on_a_spring_hangs_as_far_as_its_stiffness_says() -> None:
    """Under a steady force the elongation is force times compliance, however many sweeps."""
    compliance, gravity = 0.02, 9.81  # m/N for a mass of 1 kg
    for sweeps in (1, 4):
        position, velocity = ends(1.0), np.zeros((2, 3))
        for _ in range(9000):
            previous = position.copy()
            velocity[1, 0] += SUBSTEP * gravity
            position = position + SUBSTEP * velocity
            scaled = compliance / SUBSTEP**2
            position = sweep(
                position, previous, (0.0, 1.0), scaled, scaled, 0.05 / SUBSTEP, sweeps
            )
            velocity = (position - previous) / SUBSTEP
        assert position[1, 0] - 1.0 == pytest.approx(compliance * gravity, rel=1e-3)


def test_damping_takes_energy() -> None:
    """An overdamped spring creeps back with its retardation time and never overshoots."""
    retardation, compliance = 0.05, 1e-5
    position, velocity = ends(1.1), np.zeros((2, 3))
    lengths = []
    for _ in range(100):
        previous = position.copy()
        position = position + SUBSTEP * velocity
        scaled = compliance / SUBSTEP**2
        position = sweep(position, previous, (0.0, 1.0), scaled, scaled, retardation / SUBSTEP, 3)
        velocity = (position - previous) / SUBSTEP
        lengths.append(position[1, 0])
    assert np.all(np.diff(lengths) < 0.0) and min(lengths) >= 1.0
    # exp(-0.1 / 0.05) of the elongation is left after 0.1 s, less a start-up of some per cent.
    assert lengths[-1] - 1.0 == pytest.approx(0.1 * np.exp(-2.0), rel=0.1)
