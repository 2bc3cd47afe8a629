"""The node graph as its users call it: what works, what is refused, what survives."""

import time

import numpy as np
import pytest
from geometry_msgs.msg import Point

from emd_cell.ros.cell_client import CellClient
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.neat_folds import neat_fold
from emd_core.errors import (
    CellError,
    ErrorCode,
    InvalidInputError,
    NoHemError,
    OutOfReachError,
)
from emd_core.frames import FieldOfView
from emd_core.independent_manipulation import IndependentManipulation
from emd_core.manipulation import Manipulation
from emd_core.metrics import silhouette_iou, voxel_mse
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import ExecuteManipulation, PlanFold
from emd_msgs_py.srv import PlanFold as PlanFoldService

pytestmark = pytest.mark.system

HALF = Manipulation(np.array([[-0.2, -0.2], [-0.2, 0.2]]), np.array([0.4, 0.0]))
ONE_HAND = Manipulation(np.array([[-0.2, -0.2], [np.nan, np.nan]]), np.array([0.15, 0.15]))


def half_goal() -> VoxelGrid:
    """What the half fold should look like."""
    return neat_fold("half", ClothConfig()).goal_grid(FieldOfView())


def assert_alive(client: CellClient) -> None:
    """Perception answers, and so do planner and executor to a senseless goal."""
    assert client.capture().quality > 0.5
    with pytest.raises(InvalidInputError):
        client.plan(half_goal(), VoxelGrid(np.zeros((32, 32, 16), dtype=bool)), 1, 0)


def test_perception_sees_what_the_simulator_knows(client, fresh_cloth) -> None:
    """A flat cloth, through the noisy camera, is the true grid but for its rim."""
    seen, truth = client.capture(), client.true_grid()
    assert silhouette_iou(seen.grid, truth) > 0.93
    assert voxel_mse(seen.grid, truth) < 0.004


def test_the_arms_fold_the_cloth_in_half(client, fresh_cloth) -> None:
    """Both arms carry the far side onto the near one; the hands grasp at the hem."""
    before = voxel_mse(client.true_grid(), half_goal())
    client.capture()
    phases: list[str] = []
    done = client.execute(HALF, lambda phase, _: phases.append(phase))
    assert voxel_mse(client.true_grid(), half_goal()) < 0.5 * before
    assert list(dict.fromkeys(phases)) == [
        "approach", "grasp", "carry", "release", "retreat", "home",
    ]  # fmt: skip
    assert np.abs(done.grasp_points_in_table[:, 0] + 0.2).max() < 0.03


def test_each_hand_goes_its_own_way(client, fresh_cloth) -> None:
    """A goal with a displacement for each hand moves both corners by their own."""
    client.capture()
    ways = np.array([[0.30, 0.10], [0.15, -0.04]])
    before = client.true_grid()
    done = client.execute(IndependentManipulation(HALF.grasp_points_in_table, ways))
    assert isinstance(done, IndependentManipulation)
    lengths = np.linalg.norm(done.displacements_in_table, axis=1)
    assert sorted(lengths) == pytest.approx(sorted(np.linalg.norm(ways, axis=1)), abs=0.05)
    assert voxel_mse(client.true_grid(), before) > 0.01


def test_a_plan_comes_with_feedback_and_predictions(client, fresh_cloth) -> None:
    """Losses fall from iteration to iteration and the plan predicts what it costs."""
    losses: list[float] = []
    found = client.plan(
        client.capture().grid, half_goal(), 1, 0, on_feedback=lambda _, loss: losses.append(loss)
    )
    assert len(losses) > 5
    assert all(later <= earlier for earlier, later in zip(losses, losses[1:], strict=False))
    assert len(found.manipulations) == len(found.predicted_grids) == 1
    assert 0 < found.predicted_loss < found.expected_error < 0.1


def test_the_same_seed_gives_the_same_plan(client, fresh_cloth) -> None:
    """Planning is reproducible."""
    grid = client.true_grid()
    first, second = (client.plan(grid, half_goal(), 1, seed=3) for _ in range(2))
    assert first.manipulations[0].as_entry() == second.manipulations[0].as_entry()


def test_the_plan_service_answers_an_ordinary_client(client, fresh_cloth) -> None:
    """The service plans from the latest perceived grid."""
    client.capture()
    service = client.create_client(PlanFoldService, "planner/plan")
    header = conversions.header(0.0, conversions.TABLE_FRAME)
    request = PlanFoldService.Request(
        use_latest_grid=True,
        goal_grid=conversions.voxel_grid_to_message(half_goal(), header),
        steps=1,
    )
    response = client._wait(service.call_async(request), 60.0, "the plan")
    assert response.error_code == ErrorCode.NONE, response.error_msg
    assert len(response.plan.manipulations) == 1


def test_a_goal_of_another_size_is_refused(client) -> None:
    """The message says what was wanted and what came; the planner lives on."""
    small = VoxelGrid(np.ones((16, 16, 16), dtype=bool), FieldOfView(size=(16, 16, 16)))
    with pytest.raises(InvalidInputError, match="16"):
        client.plan(half_goal(), small, 1, 0)
    assert_alive(client)


def test_nan_in_a_manipulation_is_refused_before_anything_moves(client, fresh_cloth) -> None:
    """The executor names the bad value."""
    client.capture()
    request = ExecuteManipulation.Goal()
    request.manipulation.grasp_points = [Point(x=float("nan")), Point()]
    request.manipulation.used = [True, False]
    request.manipulation.displacement.x = 0.2
    with pytest.raises(InvalidInputError, match="nan"):
        client._act(client._execute, request, lambda message: None, timeout=30.0)
    assert_alive(client)


@pytest.mark.parametrize(
    ("grasp", "displacement", "expected"),
    [
        ([-0.2, -0.2], [-0.9, 0.0], OutOfReachError),
        ([0.9, 0.9], [0.1, 0.0], NoHemError),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_moves(
    client, fresh_cloth, grasp, displacement, expected
) -> None:
    """Out of reach, or nothing to grasp: the cloth lies as before."""
    client.capture()
    before = client.true_grid()
    asked = Manipulation(np.array([grasp, [np.nan, np.nan]]), np.array(displacement))
    with pytest.raises(expected):
        client.execute(asked)
    assert (client.true_grid().occupancy == before.occupancy).all()
    assert_alive(client)


def test_planning_is_cancelled_and_the_next_goal_served(client, fresh_cloth) -> None:
    """The planner stops in the middle of an iteration and takes the next goal."""
    grid = client.true_grid()
    goal_handle = client.send_goal(client._plan, plan_request(grid, restarts=64))
    time.sleep(0.3)
    result = client.cancel(goal_handle)
    assert result.error_code == ErrorCode.CANCELLED
    assert client.plan(grid, half_goal(), 1, 0, restarts=2).manipulations


def test_a_second_goal_is_refused_with_a_reason(client, fresh_cloth) -> None:
    """The planner works on one goal and says so."""
    grid = client.true_grid()
    goal_handle = client.send_goal(client._plan, plan_request(grid, restarts=64))
    time.sleep(0.3)
    with pytest.raises(CellError, match="already planning") as refused:
        client.plan(grid, half_goal(), 1, 0)
    assert refused.value.code is ErrorCode.BUSY
    client.cancel(goal_handle)


def test_a_motion_is_cancelled_and_the_next_one_works(client, fresh_cloth) -> None:
    """The arms come to rest on their path, go home, and can work again."""
    client.capture()
    header = conversions.header(0.0, conversions.TABLE_FRAME)
    request = ExecuteManipulation.Goal(
        manipulation=conversions.manipulation_to_message(ONE_HAND, header)
    )
    goal_handle = client.send_goal(client._execute, request)
    time.sleep(3.0)
    assert client.cancel(goal_handle).error_code == ErrorCode.CANCELLED
    client.go_home()
    client.reset_simulation()
    client.capture()
    client.execute(ONE_HAND)
    assert_alive(client)


def plan_request(grid: VoxelGrid, restarts: int) -> PlanFold.Goal:
    """A request for a three-step plan that takes seconds."""
    header = conversions.header(0.0, conversions.TABLE_FRAME)
    return PlanFold.Goal(
        initial_grid=conversions.voxel_grid_to_message(grid, header),
        goal_grid=conversions.voxel_grid_to_message(half_goal(), header),
        steps=3,
        restarts=restarts,
    )
