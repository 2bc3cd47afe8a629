"""The planner as a whole, on a world that is known: a patch of cloth that follows the hands."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from emd_core.errors import CancelledError, InvalidInputError, NoPlanError
from emd_core.frames import FieldOfView
from emd_core.metrics import silhouette_iou
from emd_core.voxel_grid import VoxelGrid, voxelise
from emd_planner.config import PlannerConfig, ReachConfig
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig
from emd_planner.plan import plan

FOV = FieldOfView()
HALF = torch.tensor([0.4, 0.25])
# The toy world knows moves of up to 1 and grasps within a voxel, as the paper has them.
PAPER = PlannerConfig(max_displacement=1.0, grasp_tolerance_voxels=1)
CONFIG = replace(PAPER, restarts=6, max_iterations=60)


class CarriedPatch(nn.Module):
    """Stands in for a trained net: the code is the patch's centre, and hands on it carry it."""

    def __init__(self) -> None:
        """Make the patch's world."""
        super().__init__()
        self.config = EmdNetConfig()
        self.sharpness = nn.Parameter(torch.tensor(0.03), requires_grad=False)
        self.centres = (torch.arange(32) + 0.5) / 16.0 - 1.0

    def encode(self, grids):
        """Find the patch."""
        mass = grids.any(-1).float()
        total = mass.sum((1, 2))
        x = (mass.sum(2) * self.centres).sum(1) / total
        y = (mass.sum(1) * self.centres).sum(1) / total
        return torch.stack([x, y], 1)

    def roll_out(self, codes, manipulations):
        """Move it by each displacement whose grasp is on it, almost not at all otherwise."""
        predicted = []
        for step in manipulations.unbind(1):
            grasps = step[:, :4].unflatten(1, (2, 2))
            beyond = ((grasps - codes[:, None]).abs() - HALF).amax(2).amin(1)
            codes = codes + torch.sigmoid(-beyond / 0.01)[:, None] * step[:, 4:]
            predicted.append(codes)
        return predicted

    def decode(self, codes):
        """Draw it with soft borders."""

        def inside(centre, half):
            return torch.sigmoid((half - (self.centres - centre[:, None]).abs()) / self.sharpness)

        plane = inside(codes[:, 0], HALF[0])[:, :, None] * inside(codes[:, 1], HALF[1])[:, None]
        states = torch.zeros(len(codes), 32, 32, 16)
        states[..., :2] = plane[..., None]  # the patch is two layers high
        return states


@pytest.fixture
def patch_at(rectangle, grid_of):
    """Voxelise the patch at a normalised centre."""
    return lambda x, y: grid_of(rectangle((x, y), (0.8, 0.5)))


def test_plan_carries_the_cloth_to_the_goal(patch_at):
    """One step: a grasp on the cloth, the right displacement in metres, the goal predicted."""
    goal = patch_at(0.3, 0.2)
    found = plan(CarriedPatch(), patch_at(-0.3, -0.2), goal, 1, CONFIG)
    assert len(found.manipulations) == 1
    manipulation = found.manipulations[0]
    np.testing.assert_allclose(
        manipulation.displacement_in_table, np.array([0.6, 0.4]) * FOV.half_extent, atol=0.02
    )
    grasp = manipulation.grasp_points_in_table[np.array(manipulation.used)]
    on_cloth = np.abs(grasp / FOV.half_extent - [-0.3, -0.2]) <= HALF.numpy() + 2 / 16
    assert on_cloth.all()
    assert silhouette_iou(found.predicted_grids[0], goal) > 0.7
    assert found.predicted_loss < 0.1 * found.initial_loss
    assert found.predicted_loss < found.expected_error < found.initial_loss
    assert found.predicted_probabilities.shape == (1, 32, 32, 16)
    assert found.planning_ms > 0.0
    assert found.reach_excess == 0.0


def test_what_something_hides_in_the_goal_is_no_empty_table(patch_at):
    """A hand hid half of the goal: its columns do not count, instead of pulling the cloth away."""
    initial, whole = patch_at(-0.3, -0.2), patch_at(0.3, 0.2)
    unknown = np.zeros((32, 32), dtype=bool)
    unknown[22:] = True
    seen = whole.occupancy & ~unknown[..., None]
    assert 0.2 < seen.sum() / whole.occupancy.sum() < 0.8
    found = plan(CarriedPatch(), initial, VoxelGrid(seen, FOV, unknown), 1, CONFIG)
    displacement = found.manipulations[0].displacement_in_table / FOV.half_extent
    np.testing.assert_allclose(displacement, [0.6, 0.4], atol=0.1)
    assert found.predicted_loss < 0.1 * found.initial_loss
    misled = plan(CarriedPatch(), initial, VoxelGrid(seen, FOV), 1, CONFIG)
    assert misled.predicted_loss > 3.0 * found.predicted_loss


@pytest.mark.parametrize("on_cloth", [False, True])
def test_no_hand_grasps_where_something_hides_the_cloth(patch_at, on_cloth):
    """Half of the cloth is hidden: grasps of the first step lie on the other half."""
    start = patch_at(-0.3, -0.2)
    unknown = np.zeros((32, 32), dtype=bool)
    unknown[:, :12] = True
    assert (start.silhouette & unknown).any() and (start.silhouette & ~unknown).any()
    initial = VoxelGrid(start.occupancy, FOV, unknown)
    config = replace(CONFIG, grasp_on_cloth=on_cloth)
    for seed in range(3):
        found = plan(CarriedPatch(), initial, patch_at(0.3, 0.2), 1, config, seed=seed)
        first = found.manipulations[0]
        points = first.grasp_points_in_table[np.array(first.used)]
        columns = np.floor((points - FOV.origin[:2]) / FOV.resolution[:2]).astype(int) % 32
        assert not unknown[columns[:, 0], columns[:, 1]].any()
    everything = VoxelGrid(start.occupancy, FOV, np.ones((32, 32), dtype=bool))
    with pytest.raises(InvalidInputError, match="hides"):
        plan(CarriedPatch(), everything, patch_at(0.3, 0.2), 1, config)


def test_hand_off_the_cloth_is_unused(patch_at):
    """A grasp point off the silhouette, beyond the tolerance, becomes NaN; some plan has one."""
    used = []
    for seed in range(6):
        config = replace(PAPER, restarts=8, max_iterations=40, start_on_cloth=False)
        found = plan(CarriedPatch(), patch_at(0.0, 0.0), patch_at(0.4, 0.1), 1, config, seed=seed)
        manipulation = found.manipulations[0]
        used.append(manipulation.used)
        for point, is_used in zip(
            manipulation.grasp_points_in_table, manipulation.used, strict=True
        ):
            assert np.isfinite(point).all() == is_used
    assert any(sum(row) == 1 for row in used)


def test_grasps_beside_the_cloth_are_moved_onto_it(patch_at):
    """What grasps within the tolerance of the silhouette grasps on it, if that is asked for."""
    initial, beside = patch_at(0.0, 0.0), []
    for grasp_on_cloth in (False, True):
        for seed in range(6):
            config = replace(
                PAPER,
                max_iterations=1,
                start_on_cloth=False,
                grasp_tolerance_voxels=16,
                grasp_on_cloth=grasp_on_cloth,
            )
            found = plan(CarriedPatch(), initial, patch_at(0.4, 0.1), 1, config, seed=seed)
            manipulation = found.manipulations[0]
            points = manipulation.grasp_points_in_table[np.array(manipulation.used)]
            columns = np.floor((points / FOV.half_extent + 1.0) * 16).astype(int)
            on_cloth = initial.silhouette[tuple(columns.T)].all()
            assert on_cloth or not grasp_on_cloth
            beside.append(not on_cloth)
    assert any(beside)


def test_a_search_in_bfloat16_finds_what_one_in_float32_finds(patch_at, small_config):
    """The plan's predictions are those of the net itself, and the search is as good."""
    config = dataclasses.replace(small_config, convolution_init=0.3, manipulation_init=0.1)
    net, losses = EmdNet(config).requires_grad_(False), []
    for bfloat16 in (False, True):
        planner = PlannerConfig(
            restarts=4, max_iterations=15, grasp_tolerance_voxels=16, bfloat16=bfloat16
        )
        found = plan(net, patch_at(0.0, 0.0), patch_at(0.3, 0.0), 1, planner)
        losses.append(found.predicted_loss)
    assert losses[1] == pytest.approx(losses[0], rel=0.05)
    assert {p.dtype for p in net.parameters()} == {torch.float32}


def test_number_of_steps_is_chosen_when_left_open(patch_at):
    """One step suffices for what one displacement can do, though three could as well."""
    config = replace(PAPER, restarts=6, max_iterations=100, max_steps=2, step_margin=0.5)
    found = plan(CarriedPatch(), patch_at(0.0, 0.0), patch_at(0.3, 0.0), 0, config)
    assert len(found.manipulations) == 1


def test_two_steps_are_taken_where_one_cannot_do(patch_at):
    """A goal 1.2 away, beyond one displacement, is reached by two moves; left open, by two."""
    config = replace(PAPER, restarts=12, max_iterations=80, max_steps=2)
    initial, goal = patch_at(-0.6, 0.0), patch_at(0.6, 0.0)
    one = plan(CarriedPatch(), initial, goal, 1, config)
    chosen = plan(CarriedPatch(), initial, goal, 0, config)
    assert len(chosen.manipulations) == len(chosen.predicted_grids) == 2
    assert chosen.predicted_loss < 0.15 * chosen.initial_loss
    assert one.predicted_loss > 2.0 * chosen.predicted_loss


def test_reach_keeps_grasp_and_release_points_inside(patch_at):
    """With the reach as a term the points stay within it, though the cloth sticks out."""
    side = 0.45 * FOV.half_extent
    square = ((-side, -side), (side, -side), (side, side), (-side, side))
    reach = ReachConfig(left=square, right=square)
    found = plan(CarriedPatch(), patch_at(-0.2, 0.0), patch_at(0.2, 0.0), 1, CONFIG, reach)
    assert found.reach_excess < 0.01
    manipulation = found.manipulations[0]
    for points in (manipulation.grasp_points_in_table, manipulation.release_points_in_table):
        assert np.nanmax(np.abs(points)) <= side + 0.01
    assert found.predicted_loss < 0.5 * found.initial_loss


def test_points_can_be_kept_within_reach_whatever_the_goal_asks_for(patch_at):
    """A goal out of reach, for which a loss of little weight lets points slip out."""
    side = 0.25 * FOV.half_extent
    square = ((-side, -side), (side, -side), (side, side), (-side, side))
    reach, slipped = ReachConfig(left=square, right=square), []
    for keep in (False, True):
        config = replace(CONFIG, keep_in_reach=keep, reach_weight=1e-3)
        for seed in range(3):
            initial, goal = patch_at(-0.3, 0.0), patch_at(0.4, 0.0)
            found = plan(CarriedPatch(), initial, goal, 2, config, reach, seed)
            for item in found.manipulations:
                points = [item.grasp_points_in_table, item.release_points_in_table]
                beyond = np.nanmax(np.abs(points)) - side
                assert beyond <= 0.0 or not keep
                slipped.append(beyond)
            assert (found.reach_excess == 0.0) or not keep
    assert max(slipped) > 1e-3


def test_same_seed_gives_the_same_plan(patch_at):
    """Plans depend on the inputs and the seed alone."""
    arguments = (CarriedPatch(), patch_at(0.0, 0.0), patch_at(0.2, 0.2), 2, CONFIG)
    one, same, other = (plan(*arguments, seed=seed) for seed in (1, 1, 2))
    for a, b in zip(one.manipulations, same.manipulations, strict=True):
        np.testing.assert_array_equal(a.grasp_points_in_table, b.grasp_points_in_table)
        np.testing.assert_array_equal(a.displacement_in_table, b.displacement_in_table)
    assert any(
        not np.array_equal(a.displacement_in_table, b.displacement_in_table)
        for a, b in zip(one.manipulations, other.manipulations, strict=True)
    )


def test_cancelling_raises_and_keeps_the_best_so_far(patch_at):
    """The caller has the best values from the progress when it stops the search."""
    told = []
    with pytest.raises(CancelledError):
        plan(
            CarriedPatch(),
            patch_at(0.0, 0.0),
            patch_at(0.3, 0.0),
            2,
            CONFIG,
            on_iteration=told.append,
            should_stop=lambda: len(told) == 4,
        )
    assert [progress.search.iteration for progress in told] == [1, 2, 3, 4]
    assert told[-1].steps == 2
    assert told[-1].search.best_values.shape == (2, 6)


def test_no_plan_if_nothing_would_be_grasped(patch_at):
    """If every restart ends off the cloth there is no plan, and the error says what to try."""

    class Repelling(CarriedPatch):
        def decode(self, codes):
            return super().decode(codes) * 0.0

    with pytest.raises(NoPlanError, match="restarts"):
        plan(Repelling(), patch_at(0.0, 0.0), patch_at(0.3, 0.0), 2, CONFIG)


def test_the_net_itself_plans_and_gradients_reach_the_manipulation(patch_at, small_config):
    """An EMD net drives the same search: the loss falls from the random start."""
    config = dataclasses.replace(small_config, convolution_init=0.3, manipulation_init=0.1)
    net = EmdNet(config).requires_grad_(False)
    told = []
    config = PlannerConfig(restarts=4, max_iterations=15, grasp_tolerance_voxels=16)
    found = plan(net, patch_at(0.0, 0.0), patch_at(0.3, 0.0), 1, config, on_iteration=told.append)
    assert found.predicted_loss < told[0].search.best_cost
    torch.testing.assert_close(
        torch.tensor(found.predicted_loss), torch.tensor(told[-1].search.best_cost)
    )


def test_bad_input_is_refused(patch_at, small_config, rectangle):
    """Grids of different boxes, empty grids, wrong sizes and negative steps are refused."""
    net, grid = EmdNet(small_config), patch_at(0.0, 0.0)
    other = voxelise(rectangle() * 0.3, FieldOfView(half_extent=0.3))
    with pytest.raises(InvalidInputError, match="one field of view"):
        plan(net, grid, other, 1)
    with pytest.raises(InvalidInputError, match="steps"):
        plan(net, grid, grid, -1)
    with pytest.raises(InvalidInputError, match="goal state holds no cloth"):
        plan(net, grid, VoxelGrid(np.zeros((32, 32, 16), dtype=bool)), 1)
    small = FieldOfView(size=(16, 16, 8))
    tiny = voxelise(rectangle() * 0.2, small)
    with pytest.raises(InvalidInputError, match="the net takes"):
        plan(net, tiny, tiny, 1)
