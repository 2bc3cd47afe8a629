"""Claims about random manipulations."""

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.hem import cloth_corners, hem_vertices, outline_corners
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_cloth_sim.random_manipulation import MODES, ManipulationRule
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.independent_manipulation import IndependentManipulation
from emd_core.manipulation import Manipulation

CONFIG = ClothConfig(vertices=(11, 11))
FOV = FieldOfView()


def draws(rule: ManipulationRule, count: int = 60, seed: int = 0) -> list:
    """Manipulations of the flat cloth."""
    cloth, rng = Cloth(CONFIG), np.random.default_rng(seed)
    return [rule.draw(cloth, FOV, rng) for _ in range(count)]


@pytest.mark.parametrize("edge_only", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_grasps_lie_on_the_cloth_and_at_its_edge_if_asked(mode: str, edge_only: bool) -> None:
    """Every grasp point is a vertex, at the hem with edge_only, and half use two hands."""
    vertices = Cloth(CONFIG).positions_in_table[:, :2]
    two_hands = inside = 0
    for drawn in draws(ManipulationRule(mode, edge_only)):
        two_hands += all(drawn.used)
        for point in drawn.grasp_points_in_table[list(drawn.used)]:
            assert np.linalg.norm(vertices - point, axis=1).min() < 1e-12
            inside += np.abs(point).max() < 0.2 - 1e-9
    assert 15 < two_hands < 45
    assert (inside == 0) == (edge_only or mode in ("hem", "fold", "neat"))


@pytest.mark.parametrize(
    ("mode", "bounds"), [("any", (0.0, 1.4)), ("hem", (0.1, 1.4)), ("paper", (0.0, 2**0.5))]
)
def test_displacements_fill_the_range_of_their_rule(mode: str, bounds: tuple) -> None:
    """Lengths lie within the rule's bounds and reach from near the lower to near the upper."""
    drawn = draws(ManipulationRule(mode), 200)
    moves = np.array([m.displacement_in_table for m in drawn]) / FOV.half_extent
    lengths = np.linalg.norm(moves, axis=1)
    assert bounds[0] <= lengths.min() and lengths.max() <= bounds[1]
    assert np.ptp(lengths) > 0.8 * (bounds[1] - bounds[0])
    if mode == "paper":
        assert np.abs(moves).max() <= 1.0 and (np.ptp(moves, axis=0) > 1.9).all()
        assert abs(np.corrcoef(moves.T)[0, 1]) < 0.2


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "neat"])
def test_independent_hands_differ(mode: str) -> None:
    """Each used hand has a displacement of its own; an unused one has none."""
    both = 0
    for drawn in draws(ManipulationRule(mode, independent_hands=True)):
        assert isinstance(drawn, IndependentManipulation)
        ways = drawn.displacements_in_table
        np.testing.assert_array_equal(np.isfinite(ways).all(axis=1), drawn.used)
        if all(drawn.used):
            both += 1
            assert np.linalg.norm(ways[0] - ways[1]) > 1e-6
    assert both > 10


def test_equal_displacements_do_what_a_shared_one_does() -> None:
    """Independent hands with the same displacement leave the cloth as a manipulation does."""
    points, way = np.array([[-0.2, -0.2], [-0.2, 0.2]]), np.array([0.1, 0.05])
    results = []
    for done in (Manipulation(points, way), IndependentManipulation(points, np.stack([way] * 2))):
        cloth = Cloth(CONFIG)
        manipulate(cloth, done)
        results.append(cloth.positions_in_table)
    np.testing.assert_array_equal(*results)


def test_each_hand_goes_its_own_way() -> None:
    """Two corners carried towards each other both arrive."""
    points = np.array([[-0.2, -0.2], [0.2, -0.2]])
    ways = np.array([[0.12, 0.0], [-0.12, 0.0]])
    cloth = Cloth(CONFIG)
    manipulate(cloth, IndependentManipulation(points, ways))
    ends = cloth.positions_in_table[cloth_corners(CONFIG.vertices)][[0, 3], :2]
    np.testing.assert_allclose(ends, points + ways, atol=0.03)


@pytest.mark.parametrize(
    ("points", "ways"),
    [
        (np.full((2, 2), np.nan), np.full((2, 2), np.nan)),
        (np.zeros((2, 2)), np.array([[0.1, 0.0], [np.nan, np.nan]])),
        (np.zeros((2, 2)), np.array([[0.1, 0.0], [np.nan, 0.0]])),
        (np.zeros((2, 2)), np.zeros(2)),
    ],
)
def test_malformed_independent_manipulations_are_refused(
    points: np.ndarray, ways: np.ndarray
) -> None:
    """Rows that are half NaN, hands without a counterpart and wrong shapes raise."""
    with pytest.raises(InvalidInputError):
        IndependentManipulation(points, ways)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, -2.0])
def test_outline_of_a_turned_rectangle_is_the_rectangle(angle: float) -> None:
    """Its corners come in order around it, whatever lies inside."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners = np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])
    inside = np.random.default_rng(0).uniform(corners[0], corners[2], (200, 2))
    found = outline_corners(np.concatenate([inside, corners]) @ turn.T) @ turn
    sides = np.linalg.norm(found - np.roll(found, 1, axis=0), axis=1)
    np.testing.assert_allclose(np.sort(sides), [0.2, 0.2, 0.4, 0.4], atol=1e-9)
    np.testing.assert_allclose(np.sort(found, axis=0), np.sort(corners, axis=0), atol=1e-9)


def test_folds_of_a_folded_cloth_begin_at_its_creases_too() -> None:
    """Of a cloth folded in half some folds carry the crease's ends along the crease."""
    cloth, rng = Cloth(CONFIG), np.random.default_rng(0)
    manipulate(cloth, neat_fold("half", CONFIG).manipulations[0])
    along_crease = 0
    for _ in range(100):
        drawn = ManipulationRule("fold").draw(cloth, FOV, rng)
        points = drawn.grasp_points_in_table[list(drawn.used)]
        at_end = (np.abs(points[:, 0]) < 0.05) & (np.abs(points[:, 1]) > 0.15)
        move = np.abs(drawn.displacement_in_table)
        along_crease += bool(at_end.any() and all(drawn.used) and move[1] > 2.0 * move[0])
    assert along_crease >= 5


def test_hem_of_a_flat_cloth_is_its_border() -> None:
    """On the flat cloth the silhouette's edge is exactly the border of the mesh."""
    cloth = Cloth(CONFIG)
    hem = hem_vertices(cloth.positions_in_table, cloth.triangles, 0.04)
    border = np.flatnonzero(np.abs(cloth.positions_in_table[:, :2]).max(axis=1) > 0.199)
    np.testing.assert_array_equal(hem, border)


def test_unknown_mode_is_rejected() -> None:
    """A mode that does not exist raises InvalidInputError."""
    with pytest.raises(InvalidInputError, match="tidy"):
        ManipulationRule("tidy")
