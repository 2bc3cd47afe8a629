"""Claims about manipulations without a robot."""

import math
from dataclasses import replace

import numpy as np
import pytest

from emd_cloth_sim import step_data
from emd_cloth_sim.cloth import REFINEMENT, Cloth
from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_cloth_sim.hand_path import arc_path
from emd_cloth_sim.manipulate import ATTEMPTS, manipulate
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_cloth_sim.presets import preset
from emd_cloth_sim.step_data import StepSettings
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.metrics import silhouette_iou
from emd_core.voxel_grid import voxelise

MEDIUM = ClothConfig(vertices=(21, 21))


def test_half_fold_folds_and_stays_folded() -> None:
    """A half fold leaves two flat layers that creep less than 2 mm in three seconds."""
    # A settle speed of nearly zero keeps the cloth from sleeping, so creep would show.
    config = ClothConfig(vertices=(31, 31), settle_speed=1e-12)
    cloth = Cloth(config)
    fold = neat_fold("half", config)
    path = HandPathConfig(settle_time_limit=0.5)
    outcome = manipulate(cloth, fold.manipulations[0], path)
    folded = cloth.positions_in_table
    assert outcome.held_counts == (1, 1) and not outcome.diagnostics.failure
    assert outcome.diagnostics.stretch_p99 < 1.03
    assert np.linalg.norm(folded - fold.goal_positions, axis=1).mean() < 5e-3
    away_from_crease = folded[:, 0] > 0.05
    layers = np.unique(folded[away_from_crease, 2].round(3))
    np.testing.assert_allclose(layers, [0.002, 0.004], atol=1e-3)
    cloth.advance(3.0)
    assert np.linalg.norm(cloth.positions_in_table - folded, axis=1).max() < 2e-3


def test_mirrored_manipulation_gives_mirrored_cloth() -> None:
    """Mirroring the grasp and the displacement mirrors the outcome, to a few millimetres."""
    results = []
    for sign in (1.0, -1.0):
        cloth = Cloth(MEDIUM)
        points = np.array([[-0.2, sign * 0.2], [np.nan, np.nan]])
        manipulate(cloth, Manipulation(points, np.array([0.15, -sign * 0.1])))
        results.append(cloth.positions_in_table.reshape(21, 21, 3))
    mirrored = results[1][:, ::-1] * np.array([1.0, -1.0, 1.0])
    assert np.linalg.norm(results[0] - mirrored, axis=2).mean() < 2e-3


def test_missing_the_cloth_changes_nothing() -> None:
    """Grasp points beside the cloth leave every bit of it as it was."""
    cloth = Cloth(MEDIUM)
    before = cloth.positions_in_table
    points = np.array([[0.25, 0.0], [np.nan, np.nan]])
    outcome = manipulate(cloth, Manipulation(points, np.array([-0.3, 0.0])))
    assert outcome.held_counts == (0, 0) and outcome.settle_time == 0.0
    assert np.array_equal(cloth.positions_in_table, before)


def test_order_of_hands_is_immaterial() -> None:
    """Swapping the two grasp points gives the same cloth."""
    results = []
    for order in (slice(None), slice(None, None, -1)):
        cloth = Cloth(MEDIUM)
        points = np.array([[-0.2, -0.2], [-0.2, 0.2]])[order]
        manipulate(cloth, Manipulation(points, np.array([0.2, 0.0])))
        results.append(cloth.positions_in_table)
    np.testing.assert_allclose(results[0], results[1], atol=1e-6)


def test_path_never_drags_the_lower_layer() -> None:
    """Along the arc the hand stays within half the displacement of a crease half-way."""
    for distance in (0.03, 0.2, 0.4):
        path = arc_path(np.zeros(3), np.array([distance, 0.0]), 0.0, HandPathConfig())
        times = np.linspace(0, path.duration, 50)
        x, _, height = np.array([path.position_in_table(t) for t in times]).T
        assert ((x - distance / 2) ** 2 + height**2 <= (distance / 2) ** 2 + 1e-12).all()
        np.testing.assert_allclose([x[0], x[-1]], [0, distance], atol=1e-12)


def test_path_keeps_the_speed() -> None:
    """The horizontal speed reaches, but does not exceed, the hand speed."""
    config = HandPathConfig()
    path = arc_path(np.zeros(3), np.array([0.0, 0.4]), 0.01, config)
    times = np.linspace(0, path.duration, 400)
    y = np.array([path.position_in_table(t)[1] for t in times])
    assert np.diff(y).max() / np.diff(times)[0] <= config.hand_speed
    assert np.diff(y).max() / np.diff(times)[0] > 0.9 * config.hand_speed


@pytest.mark.parametrize("name", NEAT_FOLDS)
def test_ideal_fold_keeps_lengths_and_layers(name: str) -> None:
    """Ideal folds keep each edge's length off the crease, and layers one thickness apart."""
    fold = neat_fold(name)
    grid = fold.goal_positions.reshape(41, 41, 3)
    edges = np.linalg.norm(np.diff(grid[..., :2], axis=0), axis=-1)
    assert edges.max() < 0.0101 and (np.abs(edges - 0.01) < 1e-9).mean() > 0.9
    layers = fold.goal_positions[:, 2] / 0.003 - 0.5
    np.testing.assert_allclose(layers, layers.round(), atol=1e-9)
    most = {"quarter": 3, "thirds": 2}.get(name, 1)
    assert layers.min() == pytest.approx(0) and most <= layers.max().round() <= most + 1
    assert fold.goal_grid().occupancy.any()


@pytest.mark.parametrize("name", ["half", "half_left", "diagonal", "corner"])
def test_manipulations_make_the_fold(name: str) -> None:
    """Performing a fold's manipulations gives its ideal silhouette."""
    fold = neat_fold(name, MEDIUM)
    cloth = Cloth(MEDIUM)
    for manipulation in fold.manipulations:
        manipulate(cloth, manipulation)
    # At 21 x 21 vertices the grid has holes, so the silhouettes of vertices are compared coarsely.
    assert silhouette_iou(voxelise(cloth.top_surface_in_table), fold.goal_grid()) > 0.7
    error = np.linalg.norm(cloth.positions_in_table - fold.goal_positions, axis=1)
    assert error.mean() < 6e-3


def test_unknown_fold_is_rejected() -> None:
    """A name that is no fold raises InvalidInputError."""
    with pytest.raises(InvalidInputError):
        neat_fold("swan")


def test_a_cloth_goes_back_to_what_it_was() -> None:
    """From a remembered moment, rest shape and all, the same manipulation gives the same bits."""
    material = preset("reference", (21, 21))
    cloth = Cloth(material.cloth)
    first = Manipulation(np.array([[0.19, 0.0], [np.nan, np.nan]]), np.array([-0.15, 0.02]))
    second = Manipulation(np.array([[0.0, 0.19], [0.0, -0.19]]), np.array([0.1, 0.02]))
    manipulate(cloth, first, material.path)
    moment = cloth.remember()
    manipulate(cloth, second, material.path)
    outcomes = []
    for _ in range(2):
        cloth.go_back(moment)
        assert cloth.held_count(0) == cloth.held_count(1) == 0
        np.testing.assert_array_equal(cloth.positions_in_table, moment.position)
        assert cloth.check().stretch_p99 < 1.03  # other rest lengths would show here
        manipulate(cloth, second, material.path)
        outcomes.append(cloth.positions_in_table)
    np.testing.assert_array_equal(*outcomes)


def test_what_cannot_be_believed_is_simulated_again_in_shorter_substeps(monkeypatch) -> None:
    """Until it can, `ATTEMPTS` times at most; the last outcome is told as it is."""
    used = []

    def step_settings(config: ClothConfig, substep: float, substeps: int) -> StepSettings:
        used.append(substeps)
        return step_data.step_settings(config, substep, substeps)

    monkeypatch.setattr("emd_cloth_sim.cloth.step_settings", step_settings)
    move = Manipulation(np.array([[0.19, 0.0], [np.nan, np.nan]]), np.array([-0.1, 0.0]))
    usual = Cloth(MEDIUM)
    assert manipulate(usual, move).attempts == 1
    assert set(used) == {MEDIUM.mesh_substeps}
    used.clear()
    strict = replace(MEDIUM, max_stretch=1e-6)
    cloth = Cloth(strict)
    outcome = manipulate(cloth, move)
    assert outcome.attempts == ATTEMPTS and "stretch" in outcome.diagnostics.failure
    finest = math.ceil(MEDIUM.mesh_substeps * REFINEMENT ** (ATTEMPTS - 1))
    assert max(used) == finest and min(used) == MEDIUM.mesh_substeps
    assert cloth.refinement == 0


def test_hands_that_jump_take_more_time_at_every_attempt() -> None:
    """A short move of the reference, whose path begins far beside the grasp."""
    material = preset("reference", (21, 21))
    material = replace(material, path=replace(material.path, frames_after=1, frames_more=0))
    move = Manipulation(np.array([[0.19, 0.0], [np.nan, np.nan]]), np.array([-0.01, 0.0]))
    usual = manipulate(Cloth(material.cloth), move, material.path)
    strict = Cloth(replace(material.cloth, max_stretch=1e-9))
    last = manipulate(strict, move, material.path)
    assert usual.attempts == 1 and last.attempts == ATTEMPTS
    assert last.carry_time > 1.5 * usual.carry_time


def test_a_start_that_crosses_itself_is_simulated_once() -> None:
    """No substep mends what is wrong from the start; the outcome tells it."""
    positions = Cloth(MEDIUM).positions_in_table
    far = positions[:, 0] < -1e-9
    positions[far, 0] *= -1
    positions[:, 2] += 0.05
    positions[far, 2] += 0.2 * (positions[far, 0] - 0.107)
    positions[far, 1] += 0.007
    cloth = Cloth.from_positions(positions, MEDIUM)
    move = Manipulation(np.array([[0.1, 0.0], [np.nan, np.nan]]), np.array([0.02, 0.0]))
    outcome = manipulate(cloth, move, HandPathConfig(settle_time_limit=0.02))
    assert outcome.attempts == 1 and "passes through itself" in outcome.diagnostics.failure
