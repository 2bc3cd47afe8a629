"""Hands with fingers: they hold what is between them, and lose what is pulled out."""

from __future__ import annotations

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.frames import FloatArray
from emd_core.simulated_cloth import Jaws

CONFIG = ClothConfig()
NAILS = Jaws(np.array([-0.006, -0.010, -0.055]), np.array([0.006, 0.010, 0.003]), slip=0.020)


def hand_at(x: float, y: float, height: float = 0.004, turn: float = 0.0) -> FloatArray:
    """A hand that points straight down and opens along an angle from the x axis."""
    cosine, sine = np.cos(turn), np.sin(turn)
    transform = np.eye(4)
    transform[:3, :3] = [[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]]
    transform[:3, 3] = x, y, height
    return transform


@pytest.mark.parametrize("turn", [0.0, np.pi / 2])
def test_fingers_hold_what_is_between_them(turn: float) -> None:
    """The vertices that rise with the hand lay between the nails, and none lay there besides."""
    cloth, hand = Cloth(ClothConfig(vertices=(81, 81))), hand_at(-0.19, 0.052, turn=turn)
    before = cloth.positions_in_table
    count = cloth.grasp(0, hand, NAILS)
    hand[2, 3] += 0.02
    cloth.move_hand(0, hand)
    for _ in range(24):
        cloth.advance(1 / 240)
    risen = np.argsort(before[:, 2] - cloth.positions_in_table[:, 2])[:count]
    reach = (0.006, 0.010) if turn == 0.0 else (0.010, 0.006)
    between = (np.abs(before[:, :2] - hand[:2, 3]) <= reach).all(axis=1)
    assert sorted(risen) == np.flatnonzero(between).tolist()


@pytest.mark.parametrize("turn", np.linspace(0.0, np.pi, 7))
@pytest.mark.parametrize("vertices", [21, 41, 81])
def test_fingers_over_cloth_never_miss_it(turn: float, vertices: int) -> None:
    """However coarse the mesh and however the hand is turned, something is between the nails."""
    rng = np.random.default_rng(vertices)
    cloth = Cloth(ClothConfig(vertices=(vertices, vertices)))
    for x, y in rng.uniform(-0.19, 0.19, (40, 2)):
        assert cloth.grasp(0, hand_at(x, y, turn=turn), NAILS) > 0
        cloth.release(0)


@pytest.mark.parametrize(
    "hand", [hand_at(-0.19, 0.0, height=0.008), hand_at(-0.212, 0.0), hand_at(0.0, 0.215)]
)
def test_fingers_miss_what_is_not_between_them(hand: FloatArray) -> None:
    """Nails 2 mm above the cloth, or beside its hem, take nothing."""
    cloth = Cloth(CONFIG)
    assert cloth.grasp(0, hand, NAILS) == 0
    assert cloth.held_count(0) == 0


def test_fingers_take_all_layers_that_lie_between_them() -> None:
    """Of two layers both are held; one that is above the fingers is not."""
    positions = Cloth(CONFIG).positions_in_table
    right = positions[:, 0] > 1e-6
    positions[right, 0] *= -1.0
    for height, layers in ((0.003, 2), (0.07, 1)):
        pile = positions.copy()
        pile[right, 2] += height
        cloth = Cloth.from_positions(pile, CONFIG)
        low = Cloth(CONFIG).grasp(0, hand_at(-0.19, 0.0), NAILS)
        assert cloth.grasp(0, hand_at(-0.19, 0.0), NAILS) == layers * low


def pull(jaws: Jaws | None, way: float = 0.06) -> Cloth:
    """Hold opposite hems and pull them apart beyond the cloth's length."""
    cloth = Cloth(ClothConfig(vertices=(21, 21)))
    for hand, x in enumerate((-0.19, 0.19)):
        assert cloth.grasp(hand, hand_at(x, 0.0), jaws) > 0
    for step in range(1, 121):
        for hand, x in enumerate((-0.19, 0.19)):
            cloth.move_hand(hand, hand_at(x + np.sign(x) * way / 2 * step / 120, 0.0, 0.02))
        cloth.advance(1 / 240)
    return cloth


def test_cloth_is_pulled_out_of_fingers() -> None:
    """Hands 60 mm farther apart than the cloth is long: it leaves at least one of them."""
    cloth = pull(NAILS)
    assert min(cloth.held_count(0), cloth.held_count(1)) == 0
    cloth.check(raise_on_failure=True)


def test_cloth_that_follows_is_kept() -> None:
    """Hands that move within the cloth's length lose nothing."""
    cloth = pull(NAILS, way=-0.10)
    assert min(cloth.held_count(0), cloth.held_count(1)) > 0


def test_a_hand_without_fingers_loses_nothing() -> None:
    """Manipulations without a robot hold on, as the data for training have it."""
    assert min(pull(None).held_count(0), pull(None).held_count(1)) > 0


def test_cloth_that_is_lost_falls() -> None:
    """Held still in the air, then lost by both hands at once, it does not stay up there."""
    cloth = pull(NAILS, way=-0.10)
    for _ in range(600):
        cloth.advance(1 / 240)
    held = cloth.positions_in_table[:, 2]
    assert cloth.settled
    for hand in cloth._hands:
        hand.slip = -1.0
    cloth.advance(1 / 240)
    assert cloth.held_count(0) == cloth.held_count(1) == 0 and not cloth.settled
    cloth.advance(1.0)
    fallen = cloth.positions_in_table[:, 2]
    assert cloth.settled and fallen.mean() < 0.9 * held.mean() and fallen.max() < held.max()
