"""Claims about the synthetic scenes by which perception is judged."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_cell.scenes.cloth_states import SHAPES, ClothState, draw_state
from emd_cell.scenes.looks import CLOTHS, TABLES, draw_look
from emd_cell.scenes.scene import SceneMaker, column_centres
from emd_cell.scenes.store import SceneStore, scenes_key
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import build_mesh
from emd_cloth_sim.neat_folds import neat_fold
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise

SMALL = ClothConfig(vertices=(21, 21), thickness=0.003)


@pytest.fixture(scope="module")
def maker() -> SceneMaker:
    """A maker of small scenes of two frames."""
    return SceneMaker(0, SMALL, 2)


@pytest.mark.parametrize(("fold", "layers"), [("half", 2), ("quarter", 4)])
def test_layers_of_an_ideal_fold_are_counted(fold: str, layers: int) -> None:
    """Inside the fold all of them, beside it none."""
    ideal = neat_fold(fold, SMALL)
    triangles = build_mesh(SMALL.vertices, SMALL.spacing).triangles
    state = ClothState(fold, SMALL, ideal.goal_positions, triangles)
    middle = 0.5 * (ideal.goal_positions.min(axis=0) + ideal.goal_positions.max(axis=0))[:2]
    places = np.stack([middle + [0.001, 0.002], middle + [0.35, 0.0]])
    assert state.layers_at(places).tolist() == [layers, 0]


def test_a_scene_is_what_its_number_says(maker: SceneMaker) -> None:
    """The same again, another one for another number, and truths that fit each other."""
    scene, again, other = maker.make(2), maker.make(2), maker.make(7)
    assert all(np.array_equal(*pair) for pair in zip(scene.colours, again.colours, strict=True))
    assert np.array_equal(scene.depths[1], again.depths[1], equal_nan=True)
    assert not np.array_equal(scene.colours[0], other.colours[0])
    assert not np.array_equal(scene.colours[0], scene.colours[1])  # noise
    assert 5000 < scene.mask.sum() < scene.mask.size
    covered = scene.grid.silhouette
    assert (scene.layers[~covered] == 0).all()
    assert ((scene.heights > 0.0) == covered).mean() > 0.95  # the grid wraps


def test_column_centres_lie_in_their_columns() -> None:
    """One point in each column covers all of them."""
    points = column_centres(FieldOfView())
    grid = voxelise(np.column_stack([points, np.full(len(points), 0.01)]))
    assert grid.silhouette.all()


def test_a_hand_in_view_hides_cloth_and_goes_away(
    maker: SceneMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Asked for always it hides some cloth; the next scene's robot stands as before."""
    bare = maker.make(2)
    monkeypatch.setattr("emd_cell.scenes.scene.HANDS_SHARE", 1.0)
    hidden = [scene for scene in map(maker.make, (2, 7)) if scene.hand_in_view]
    assert hidden and all(scene.mask.sum() > 0 for scene in hidden)
    monkeypatch.undo()
    again = maker.make(2)
    assert not bare.hand_in_view and np.array_equal(again.mask, bare.mask)
    assert hidden[0].name != "0002" or hidden[0].mask.sum() < bare.mask.sum()


def test_looks_and_shapes_of_all_kinds_are_drawn() -> None:
    """A lamp takes light away from it, and patterns have two colours."""
    rng, cloths, tables = np.random.default_rng(0), set(), set()
    for _ in range(60):
        look = draw_look(rng, SMALL, CellGeometry())
        cloths.add(look.cloth)
        tables.add(look.table)
        colours = len(np.unique(look.cloth_colours, axis=0))
        assert colours == (2 if look.cloth in ("striped", "chequered") else 1)
        lit = look.lit(np.full((48, 64, 3), 100, dtype=np.uint8)).astype(float)
        assert lit.max() <= 106.0 and lit.min() >= 100.0 * 0.92 * 0.55
    assert cloths == set(CLOTHS) and tables == set(TABLES)
    drawn = {draw_state(np.random.default_rng(seed), SMALL).shape for seed in range(25)}
    assert drawn >= {"flat", "half", "quarter", "crumpled"} and drawn <= set(SHAPES)


def test_a_kept_scene_is_taken_again_and_not_made_anew(tmp_path, monkeypatch) -> None:
    """The second time the file answers; other arguments get files of their own."""
    first = SceneStore(0, SMALL, 1, tmp_path).scene(2)
    monkeypatch.setattr(SceneMaker, "make", None)
    kept = SceneStore(0, SMALL, 1, tmp_path).scene(2)
    np.testing.assert_array_equal(kept.depths[0], first.depths[0])
    assert kept.name == first.name
    assert scenes_key(0, SMALL, 1) != scenes_key(1, SMALL, 1)
