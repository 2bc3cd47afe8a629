"""Augmentation keeps examples true (paper, III-B)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.augmentation import (
    SYMMETRIES,
    augment,
    delay,
    failing_steps,
    transform,
)
from emd_planner.dataset import Windows
from emd_planner.rasterise import rasterise
from emd_planner.silhouette import columns_of, dilate, outside_cloth, silhouettes
from emd_planner.training_config import AugmentationConfig
from emd_planner.unused_hands import fill_unused, miss_narrowly, random_points_outside

QUARTER_TURNS = AugmentationConfig(free_share=0.0, near_miss_share=0.0)


@pytest.fixture
def example(grid_of):
    """An uneven point set, one manipulation, and the points after it (all carried along)."""
    generator = np.random.default_rng(5)
    before = generator.uniform([-0.4, -0.6, 0.0], [0.7, 0.2, 0.24], (60, 3))
    grasps = before[:2, :2]
    move = np.array([0.31, -0.22])
    after = before + [*move, 0.0]
    grids = np.stack([grid_of(points).occupancy for points in (before, after)])
    manipulation = np.concatenate([grasps.ravel(), move])
    return (
        (before, after),
        torch.from_numpy(grids)[None],
        torch.from_numpy(manipulation).float()[None, None],
    )


@pytest.mark.parametrize("symmetry", range(8))
@pytest.mark.parametrize("shift", [(0, 0), (5, -12)])
def test_transform_then_rasterise_equals_rasterise_then_transform(
    example, grid_of, symmetry, shift
):
    """Turned, mirrored and shifted grids are the grids of the moved points, before and after."""
    states, grids, manipulations = example
    matrix = SYMMETRIES[symmetry].double().numpy()
    offset = np.array(shift) / 16.0
    moved, changed = transform(grids, manipulations, SYMMETRIES[[symmetry]], torch.tensor([shift]))
    for points, grid in zip(states, moved[0], strict=True):
        xy = (points[:, :2] @ matrix.T + offset + 1.0) % 2.0 - 1.0
        wanted = grid_of(np.column_stack([xy, points[:, 2]])).occupancy
        np.testing.assert_array_equal(grid.numpy(), wanted)
    # The hands still take the same two points of the cloth, and carry them as the outcome shows.
    grasped = (states[0][:2, :2] @ matrix.T + offset + 1.0) % 2.0 - 1.0
    np.testing.assert_allclose(changed[0, 0, :4].numpy(), grasped.ravel(), atol=1e-6)
    move = (states[1] - states[0])[0, :2] @ matrix.T
    np.testing.assert_allclose(changed[0, 0, 4:].numpy(), move, atol=1e-6)


def test_symmetries_are_the_eight_of_the_square():
    """Four quarter turns and four mirrorings, all different, closed under composition."""
    matrices = {tuple(matrix.flatten().tolist()) for matrix in SYMMETRIES}
    assert len(matrices) == 8
    products = {tuple((a @ b).flatten().tolist()) for a in SYMMETRIES for b in SYMMETRIES}
    assert products == matrices


def test_failed_grasp_leaves_a_copy_of_the_initial_state(example):
    """A failing step grasps nothing, keeps its displacement and changes nothing."""
    _, grids, manipulations = example
    position = failing_steps(manipulations, 1.0, torch.Generator())
    failed, changed = delay(grids, manipulations, position)
    assert torch.equal(failed[0, 1], grids[0, 0])
    assert changed[0, 0, :4].isnan().all()
    assert torch.equal(changed[0, 0, 4:], manipulations[0, 0, 4:])


def test_failure_in_a_longer_window_delays_what_follows():
    """After a failed step the window goes on as recorded, one step later."""
    grids = torch.arange(4).view(1, 4, 1, 1, 1).expand(60, 4, 32, 32, 16)
    manipulations = torch.arange(3.0).view(1, 3, 1).expand(60, 3, 6)
    position = failing_steps(manipulations, 1.0, torch.Generator().manual_seed(0))
    failed, changed = delay(grids, manipulations, position)
    seen = set()
    for states, steps in zip(failed[..., 0, 0, 0], changed, strict=True):
        position = int(steps[:, 0].isnan().nonzero()[0])
        seen.add(position)
        assert states[position] == states[position + 1]
        real = [int(step[0]) for step in steps if not step[0].isnan()]
        assert real == [0, 1]
        assert states.unique().tolist() == [0, 1, 2]
    assert seen == {0, 1, 2}


def test_unused_hands_are_put_outside_the_cloth(example):
    """Points of unused hands land off the silhouette, with a margin; the others stay."""
    _, grids, manipulations = example
    grids, manipulations = grids.repeat(50, 1, 1, 1, 1), manipulations.repeat(50, 1, 1)
    manipulations[:, 0, 2:4] = torch.nan
    filled = fill_unused(grids[:, :1], manipulations, torch.Generator(), margin_voxels=1)
    silhouette = silhouettes(grids[:, :1])
    assert outside_cloth(filled[..., 2:4], dilate(silhouette, 1)).all()
    assert not outside_cloth(filled[..., 0:2], silhouette).any()
    assert torch.equal(filled[..., [0, 1, 4, 5]], manipulations[..., [0, 1, 4, 5]])
    assert filled[..., 2:4].std() > 0.3


def test_points_outside_a_cloth_that_leaves_little_room_are_still_outside():
    """With one free column the points land on it, whatever the margin."""
    silhouette = torch.ones(1, 32, 32, dtype=torch.bool)
    silhouette[0, 3, 30] = False
    points = random_points_outside(silhouette, torch.Generator(), margin_voxels=2)
    assert (columns_of(points, 32) == torch.tensor([3, 30])).all()


def test_silhouette_wraps_when_points_are_compared():
    """A point past the right edge lies on the cloth at the left edge; so does the margin."""
    silhouette = torch.zeros(32, 32, dtype=torch.bool)
    silhouette[0, 16] = True
    point = torch.tensor([1.03, 0.03])
    assert not outside_cloth(point, silhouette)
    assert outside_cloth(point - torch.tensor([0.06, 0.0]), silhouette)
    assert not outside_cloth(point - torch.tensor([0.06, 0.0]), dilate(silhouette, 1))


def test_augmented_windows_are_complete_and_vary(example):
    """Nothing is NaN any more, and hands swap, turn and fail at about the configured rates."""
    _, grids, manipulations = example
    batch = 400
    grids, manipulations = grids.repeat(batch, 1, 1, 1, 1), manipulations.repeat(batch, 1, 1)
    config = dataclasses.replace(QUARTER_TURNS, failure_probability=0.25, translation_voxels=4)
    examples = augment(Windows(grids, manipulations), config, torch.Generator().manual_seed(1))
    states, steps = examples.grids, examples.manipulations
    assert states.dtype == torch.bool
    assert steps.isfinite().all()
    assert steps[..., :4].abs().max() <= 1.0
    unchanged = (states[:, 0] == states[:, 1]).flatten(1).all(1)
    assert 0.15 < unchanged.float().mean() < 0.35
    silhouette = silhouettes(states[:, :1])
    off = outside_cloth(steps[..., :2], silhouette) & outside_cloth(steps[..., 2:4], silhouette)
    assert torch.equal(off[:, 0], unchanged)
    assert len(states.flatten(1).unique(dim=0)) > 200


def test_windows_past_the_end_of_a_sequence_get_an_idle_step_anywhere(example):
    """A filler step (all NaN) is spread over the window and grasps outside the cloth."""
    _, grids, manipulations = example
    grids = torch.cat([grids, grids[:, 1:]], dim=1).repeat(200, 1, 1, 1, 1)
    idle = torch.full_like(manipulations, torch.nan)
    manipulations = torch.cat([manipulations, idle], dim=1).repeat(200, 1, 1)
    config = dataclasses.replace(QUARTER_TURNS, failure_probability=0.0)
    examples = augment(Windows(grids, manipulations), config, torch.Generator().manual_seed(1))
    states, steps = examples.grids, examples.manipulations
    first = (states[:, 0] == states[:, 1]).flatten(1).all(1)
    second = (states[:, 1] == states[:, 2]).flatten(1).all(1)
    assert (first ^ second).all()
    assert 0.3 < first.float().mean() < 0.7
    off = outside_cloth(steps[..., :2], silhouettes(states[:, :-1]))
    assert torch.equal(off[:, 0], first)
    assert torch.equal(off[:, 1], second)


def test_augmentation_depends_on_the_seed_alone(example):
    """The same generator state gives the same windows."""
    _, grids, manipulations = example
    config = dataclasses.replace(QUARTER_TURNS, translation_voxels=3)
    one, same = (
        augment(Windows(grids, manipulations), config, torch.Generator().manual_seed(7))
        for _ in range(2)
    )
    assert torch.equal(one.grids, same.grids)
    assert torch.equal(one.manipulations, same.manipulations)


def test_cloth_turned_freely_is_still_held_and_carried(example):
    """At any angle the grasped points stay on the cloth, and the outcome is the one recorded."""
    states, grids, manipulations = example
    batch = 200
    points = torch.from_numpy(np.stack(states)).float()[None].repeat(batch, 1, 1, 1)
    windows = Windows(grids.repeat(batch, 1, 1, 1, 1), manipulations.repeat(batch, 1, 1), points)
    config = AugmentationConfig(free_share=1.0, failure_probability=0.0)
    examples = augment(windows, config, torch.Generator().manual_seed(2))
    turned, changed = examples.grids, examples.manipulations
    lengths = changed[:, 0, 4:].norm(dim=1)
    torch.testing.assert_close(lengths, manipulations[0, 0, 4:].norm().expand(batch))
    angles = torch.atan2(changed[:, 0, 5], changed[:, 0, 4])
    assert angles.std() > 1.5
    for hand in (slice(0, 2), slice(2, 4)):
        # The example's first points are grasped: their columns hold cloth before, and where the
        # hand lets go the column holds cloth after.
        assert not outside_cloth(changed[:, 0, hand], silhouettes(turned[:, 0])).any()
        released = changed[:, 0, hand] + changed[:, 0, 4:]
        assert not outside_cloth(released, silhouettes(turned[:, 1])).any()


@pytest.mark.parametrize("wanted", ["free_share", "near_miss_share"])
def test_free_turns_and_near_misses_need_points(example, wanted):
    """Data without vertices cannot be turned freely, and the error says what to do."""
    _, grids, manipulations = example
    config = dataclasses.replace(QUARTER_TURNS, **{wanted: 1.0})
    with pytest.raises(InvalidInputError, match="set free_share and near_miss_share to 0"):
        augment(Windows(grids, manipulations), config, torch.Generator())


def test_examples_without_points_are_left_out_of_free_turns_and_near_misses(example):
    """Beside others that have points: only those are turned by odd angles or missed narrowly."""
    states, grids, manipulations = example
    batch = 40
    points = torch.from_numpy(np.stack(states)).float()[None].repeat(batch, 1, 1, 1)
    points[::2] = torch.nan
    manipulations = manipulations.repeat(batch, 1, 1)
    manipulations[:, 0, 2:4] = torch.nan
    config = dataclasses.replace(
        QUARTER_TURNS,
        free_share=1.0,
        near_miss_share=1.0,
        failure_probability=0.0,
        swap_grasps=False,
        outside_margin_voxels=2,
    )
    windows = Windows(grids.repeat(batch, 1, 1, 1, 1), manipulations, points)
    examples = augment(windows, config, torch.Generator().manual_seed(5))
    assert examples.manipulations.isfinite().all()
    counts = examples.grids.flatten(2).sum(-1)
    assert (counts[::2] == counts[0]).all()  # whole voxels and quarter turns keep every column
    assert (counts[1::2] != counts[0]).any()
    far = dilate(silhouettes(examples.grids[:, 0]), 2)
    beside = ~outside_cloth(examples.manipulations[:, 0, 2:4], far)
    assert not beside[::2].any() and beside[1::2].any()


def test_near_misses_lie_at_the_edge_and_touch_no_point_of_the_cloth(example):
    """Unused points land at the silhouette's edge, beyond the reach of a closing hand."""
    states, grids, manipulations = example
    batch = 300
    points = torch.from_numpy(np.stack(states)).float()[None].repeat(batch, 1, 1, 1)
    grids, manipulations = grids.repeat(batch, 1, 1, 1, 1), manipulations.repeat(batch, 1, 1)
    manipulations[:, 0, 2:4] = torch.nan
    config = AugmentationConfig(near_miss_share=1.0, near_miss_clearance=0.04)
    filled = miss_narrowly(grids, points, manipulations, config, torch.Generator().manual_seed(0))
    assert torch.equal(filled[..., [0, 1, 4, 5]], manipulations[..., [0, 1, 4, 5]])
    places = filled[:, 0, 2:4]
    missed = places[~places.isnan().any(1)]
    assert len(missed) > batch / 2
    distances = torch.cdist(missed, points[0, 0, :, :2]).amin(1)
    assert distances.min() > 0.04
    silhouette = silhouettes(grids[: len(missed), 0])
    assert not outside_cloth(missed, dilate(silhouette, 1)).any()
    on_it = ~outside_cloth(missed, silhouette)
    assert on_it.any()
    assert not on_it.all()


def test_examples_tell_which_hands_grasped(example):
    """However hands are swapped, a hand counts as used exactly if its point is the cloth's."""
    states, grids, manipulations = example
    batch = 200
    points = torch.from_numpy(np.stack(states)).float()[None].repeat(batch, 1, 1, 1)
    manipulations = manipulations.repeat(batch, 1, 1)
    manipulations[::2, 0, 2:4] = torch.nan
    config = dataclasses.replace(QUARTER_TURNS, near_miss_share=1.0, failure_probability=0.2)
    windows = Windows(grids.repeat(batch, 1, 1, 1, 1), manipulations, points)
    examples = augment(windows, config, torch.Generator().manual_seed(3))
    moved = (examples.grids[:, 0] != examples.grids[:, 1]).flatten(1).any(1)
    assert torch.equal(examples.used[:, 0].any(1), moved)
    assert torch.equal(examples.used[::2, 0].sum(1), moved[::2].long())
    assert torch.equal(examples.used[1::2, 0].sum(1), 2 * moved[1::2].long())


def test_rasterised_batches_equal_voxelised_clouds(example, grid_of):
    """Batches of points give the grids that `voxelise` gives one by one, wrapped and clamped."""
    generator = np.random.default_rng(3)
    clouds = generator.uniform([-1.6, -1.6, -0.1], [1.6, 1.6, 0.4], (5, 80, 3))
    grids = rasterise(torch.from_numpy(clouds), (32, 32, 16), 0.25)
    for cloud, grid in zip(clouds, grids, strict=True):
        np.testing.assert_array_equal(grid, grid_of(cloud).occupancy)
