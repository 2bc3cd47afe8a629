"""Claims about neat folds that are carried out not quite neatly."""

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_cloth_sim.neat_sequences import STRAY, astray, draw_neat_fold
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_cloth_sim.simulate_sequence import simulate_sequence
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView

FOV = FieldOfView()
CONFIG = ClothConfig(vertices=(15, 15))


def test_all_folds_are_drawn_in_all_directions() -> None:
    """Every way of folding comes up, and carries corners to corners, sides or the middle."""
    rng = np.random.default_rng(0)
    drawn = [draw_neat_fold(CONFIG, rng) for _ in range(400)]
    assert {len(fold) for fold in drawn} == {
        len(neat_fold(name, CONFIG).manipulations) for name in NEAT_FOLDS
    }
    both = [fold[0].displacement_in_table for fold in drawn if all(fold[0].used)]
    ways = {tuple(np.sign(np.round(way, 6)).astype(int)) for way in both}
    assert ways == {(1, 0), (-1, 0), (0, 1), (0, -1)}
    for fold in drawn:
        points = fold[0].grasp_points_in_table[list(fold[0].used)]
        np.testing.assert_allclose(np.abs(points), 0.2, atol=1e-9)


def test_hands_stray_but_grasp_the_edge() -> None:
    """Grasps are vertices of the edge near those meant; displacements stray by the deviation."""
    cloth, rng = Cloth(CONFIG), np.random.default_rng(1)
    wanted = neat_fold("half", CONFIG).manipulations[0]
    done = [astray(wanted, cloth, FOV, rng) for _ in range(300)]
    stray = float(FOV.table_from_normalised(STRAY))
    for manipulation in done:
        points = manipulation.grasp_points_in_table
        assert np.abs(points).max(axis=1) == pytest.approx([0.2, 0.2], abs=1e-6)
        assert np.linalg.norm(points - wanted.grasp_points_in_table, axis=1).max() < 6.0 * stray
    moves = np.array([m.displacement_in_table for m in done])
    np.testing.assert_allclose(moves.mean(0), wanted.displacement_in_table, atol=0.2 * stray)
    np.testing.assert_allclose(moves.std(0), stray, rtol=0.2)


def test_a_sequence_begins_with_a_neat_fold() -> None:
    """What is simulated first comes near one of the folds, and the sequence goes on after it."""
    config = GenerationConfig(1, 3, 4, "towel", (15, 15), ManipulationRule("neat"))
    shard = simulate_sequence(config, 0)
    first = FOV.table_from_normalised(shard.arrays["picks"][0, 0].astype(float))
    assert shard.arrays["moves"].shape == (1, 3, 2)
    used = np.isfinite(first).all(axis=1)
    assert (np.abs(first[used]).max(axis=1) > 0.19).all()
    again = simulate_sequence(config, 0)
    assert np.array_equal(shard.arrays["grids"], again.arrays["grids"])


def test_what_does_not_go_together_is_refused() -> None:
    """Oblong cloth, random starts and hands that go their own ways."""
    oblong = ClothConfig(side_lengths=(0.4, 0.3), vertices=(15, 15))
    with pytest.raises(InvalidInputError, match="square"):
        draw_neat_fold(oblong, np.random.default_rng(0))
    with pytest.raises(InvalidInputError, match="flat"):
        GenerationConfig(1, rule=ManipulationRule("neat"), start="random")
    with pytest.raises(InvalidInputError, match="alike"):
        ManipulationRule("neat", independent_hands=True)
