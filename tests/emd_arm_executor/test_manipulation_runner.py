"""Manipulations with a second try, on a robot that obeys perfectly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from emd_arm_executor.executor import ClothLostError, MotionExecutor
from emd_arm_executor.manipulation_runner import ManipulationRunner, RunCallbacks
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import CollisionError, GraspFailedError
from emd_core.manipulation import Manipulation


class EmptyJaws(MockRobot):
    """The first few times that jaws close, there is nothing between them."""

    misses = 1

    def send_gripper(self, arm: str, width: float) -> None:
        """Close on nothing while misses are left."""
        if width == 0.0:
            self.holding_width = 0.0 if self.misses > 0 else 0.002
            self.misses -= 1
        super().send_gripper(arm, width)


@pytest.fixture()
def jaws(robot: RobotModel) -> EmptyJaws:
    """A robot at rest whose first grasp misses."""
    return EmptyJaws(dict(robot.description.rest))


@pytest.fixture()
def runner(planner: MotionPlanner, robot: RobotModel, jaws: EmptyJaws) -> ManipulationRunner:
    """Carries manipulations out with that robot."""
    return ManipulationRunner(planner, MotionExecutor(jaws, robot))


@pytest.mark.parametrize("point", [[0.16, -0.16], [0.2, -0.2]])
def test_a_missed_hem_is_left_for_another(
    point: list[float],
    runner: ManipulationRunner,
    jaws: EmptyJaws,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """After a miss the hand grasps another hem, also beside a corner, and ends at rest."""
    plans: list[MotionPlan] = []
    corner = task([point], [-0.1, 0.1])
    done = runner.run(corner, towel(), RunCallbacks(on_plan=plans.append))
    assert len(plans) == 2 and done is plans[1]
    (first,), (second,) = (plan.grasps.values() for plan in plans)
    assert np.linalg.norm(first.hem.point_in_table - second.hem.point_in_table) > 0.012
    end = robot.arm_positions(("left", "right"), jaws.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)


def test_a_second_miss_is_reported_from_home(
    runner: ManipulationRunner,
    jaws: EmptyJaws,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """Two misses end the manipulation with both arms home and the jaws open."""
    jaws.misses = 2
    with pytest.raises(GraspFailedError, match="second try, both arms are home"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel())
    end = robot.arm_positions(("left", "right"), jaws.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)
    assert all(jaws.gripper_width(arm) > 0.01 for arm in robot.arms)


class Camera:
    """Sees one silhouette after the other, the last for ever."""

    def __init__(self, *seen: Silhouette) -> None:
        """Keep what is seen."""
        self._seen = list(seen)
        self.looks = 0

    def look(self) -> Silhouette:
        """Count the look."""
        self.looks += 1
        return self._seen.pop(0) if len(self._seen) > 1 else self._seen[0]


def without_corner(cloth: Silhouette) -> Silhouette:
    """The cloth when its right far corner has been folded inwards."""
    mask = cloth.mask.copy()
    x, y = np.nonzero(mask)
    places = cloth.origin_in_table + (np.stack([x, y], axis=1) + 0.5) * cloth.resolution
    gone = places @ [1.0, -1.0] > 0.25
    mask[x[gone], y[gone]] = False
    return Silhouette(mask, cloth.resolution, cloth.origin_in_table)


def test_cloth_that_stayed_where_it_was_is_grasped_again(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """Jaws that closed on something are not believed when the camera sees no change."""
    jaws.misses = 0
    camera, plans = Camera(towel(), without_corner(towel())), []
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot), camera.look)
    corner = task([[0.16, -0.16]], [-0.1, 0.1])
    # The second try grasps beside the corner, which has gone by then.
    done = runner.run(corner, towel(), RunCallbacks(on_plan=plans.append))
    assert (len(plans), camera.looks) == (2, 2) and done is plans[1]


def test_cloth_that_never_moves_is_a_failed_grasp(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """After the second look without a change the failure says what the camera saw."""
    jaws.misses = 0
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot), Camera(towel()).look)
    with pytest.raises(GraspFailedError, match="camera sees.*second try, both arms are home"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel())


def test_the_shortest_ways_are_not_judged(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """No change is no failure where the hand moves too little to make one."""
    jaws.misses, camera, plans = 0, Camera(towel()), []
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot), camera.look)
    # 44 mm, shortened by twice the grip and the jaws' depth, leave 12 mm.
    short = task([[0.2, 0.0]], [-0.044, 0.0])
    done = runner.run(short, towel(), RunCallbacks(on_plan=plans.append))
    assert (len(plans), camera.looks) == (1, 1)
    assert all(np.linalg.norm(way) < 0.02 for way in done.displacements_in_table.values())


def test_a_way_along_the_hem_is_not_judged(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """A straight hem that slides along itself looks as it looked before."""
    jaws.misses, camera, plans = 0, Camera(towel()), []
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot), camera.look)
    along = task([[0.2, -0.05]], [0.0, 0.1])
    done = runner.run(along, towel(), RunCallbacks(on_plan=plans.append))
    assert (len(plans), camera.looks) == (1, 1)
    assert all(np.linalg.norm(way) > 0.05 for way in done.displacements_in_table.values())


def test_a_way_home_that_is_blocked_is_no_refusal(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """COLLISION says that nothing has moved; after a failed grasp something has."""

    def blocked(*arguments: object, **options: object) -> MotionPlan:
        raise CollisionError("a chair stands there")

    monkeypatch.setattr(planner, "plan_home", blocked)
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot))
    with pytest.raises(GraspFailedError, match="closed on nothing.*no way home: a chair"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel())


def test_a_moved_cloth_is_not_grasped_again(
    planner: MotionPlanner,
    robot: RobotModel,
    jaws: EmptyJaws,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """Where jaws closed on nothing and yet the cloth moved, the plan no longer fits it."""
    camera = Camera(without_corner(towel()))
    runner = ManipulationRunner(planner, MotionExecutor(jaws, robot), camera.look)
    with pytest.raises(GraspFailedError, match="closed on nothing.*plan anew.*arms are home"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel())
    assert camera.looks == 1


def test_lost_cloth_is_not_grasped_again(
    runner: ManipulationRunner,
    jaws: EmptyJaws,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """Cloth that slipped out on the way lies somewhere else: arms go home and say so."""
    jaws.misses, plans = 0, []

    def slip(plan: MotionPlan, phase: PhaseName, progress: float) -> None:
        if phase is PhaseName.CARRY:
            jaws.holding_width = 0.0
            for arm in plan.grasps:
                MockRobot.send_gripper(jaws, arm, 0.0)

    callbacks = RunCallbacks(on_plan=plans.append, on_progress=slip)
    with pytest.raises(ClothLostError, match="slipped out.*both arms are home"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel(), callbacks)
    assert len(plans) == 1
    end = robot.arm_positions(("left", "right"), jaws.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)
