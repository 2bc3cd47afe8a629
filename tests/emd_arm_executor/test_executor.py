"""Carrying plans out on a robot that obeys perfectly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.executor import ClothLostError, MotionExecutor
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_interface import JointReading
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import CancelledError, CellError, GraspFailedError, TrackingError

ARMS = ("left", "right")


def _stop_at(executor: MotionExecutor, time: float) -> Callable[[], bool]:
    return lambda: executor.robot.now() >= time


def _phase_start(plan: MotionPlan, name: PhaseName) -> float:
    """When a phase begins if all goes well, seconds."""
    names = [phase.name for phase in plan.phases]
    return sum(phase.duration for phase in plan.phases[: names.index(name)])


def test_plan_runs_through(half_fold: MotionPlan, mock: MockRobot, robot: RobotModel) -> None:
    """All phases happen in their order and time, and the arms end at rest."""
    seen: list[tuple[PhaseName, float]] = []
    MotionExecutor(mock, robot).run(half_fold, lambda phase, p: seen.append((phase, p)))
    assert list(dict.fromkeys(phase for phase, _ in seen)) == list(PhaseName)
    assert mock.now() == pytest.approx(half_fold.duration, abs=0.01)
    end = robot.arm_positions(ARMS, mock.joint_positions())
    assert end == pytest.approx(robot.rest_positions(ARMS), abs=1e-5)


def test_progress_grows_from_0_to_1(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Within each phase the progress never falls, and it covers 0 to 1."""
    seen: dict[PhaseName, list[float]] = {name: [] for name in PhaseName}
    MotionExecutor(mock, robot).run(half_fold, lambda phase, p: seen[phase].append(p))
    for progress in seen.values():
        assert progress[0] == 0.0 and progress[-1] == 1.0
        assert (np.diff(progress) >= -1e-9).all()


def test_both_arms_start_together(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Every segment of a bimanual fold reaches both controllers with one start time."""
    MotionExecutor(mock, robot).run(half_fold)
    groups = [sent.group for sent in mock.sent]
    assert groups[::2] == ["left_arm"] * (len(groups) // 2)
    assert groups[1::2] == ["right_arm"] * (len(groups) // 2)
    for left, right in zip(mock.sent[::2], mock.sent[1::2], strict=True):
        assert left.start_time == right.start_time
        assert np.array_equal(left.trajectory.times, right.trajectory.times)


def test_jaws_open_close_and_open(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Jaws open on the approach, close at the hem and open at the release; never in the air."""
    MotionExecutor(mock, robot).run(half_fold)
    grasp = robot.config.grasp
    for arm in ARMS:
        commands = [(t, w) for t, name, w in mock.gripper_commands if name == arm]
        assert [w for _, w in commands] == [
            grasp.open_width,
            grasp.closed_width,
            grasp.open_width,
        ]
        wanted = [PhaseName.APPROACH, PhaseName.GRASP, PhaseName.RELEASE]
        starts = [_phase_start(half_fold, name) for name in wanted]
        assert [t for t, _ in commands] == pytest.approx(starts, abs=0.01)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4, 0.5, 0.6, 0.95])
def test_cancel_stops_within_0_4_seconds(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel, share: float
) -> None:
    """Asked at any moment, the arms are at rest within 0.4 s and one look."""
    executor = MotionExecutor(mock, robot)
    asked = share * half_fold.duration
    with pytest.raises(CancelledError):
        executor.run(half_fold, should_stop=_stop_at(executor, asked))
    assert mock.now() - asked <= 0.4 + robot.config.execution.monitor_period
    before = robot.arm_positions(ARMS, mock.joint_positions())
    mock.wait_until(mock.now() + 1.0)
    after = robot.arm_positions(ARMS, mock.joint_positions())
    assert after == pytest.approx(before, abs=1e-6)


def test_cancel_stops_on_the_path(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """After a stop while carrying, the hands have kept their relative pose."""
    executor = MotionExecutor(mock, robot)
    asked = _phase_start(half_fold, PhaseName.CARRY) + 1.5
    with pytest.raises(CancelledError, match="carry"):
        executor.run(half_fold, should_stop=_stop_at(executor, asked))
    positions = robot.arm_positions(ARMS, mock.joint_positions())
    left = robot.arms["left"].forward(positions[:6])[:3, 3]
    right = robot.arms["right"].forward(positions[6:])[:3, 3]
    poses = half_fold.via_poses_in_table
    wanted = np.linalg.norm(poses["left"][0, :3, 3] - poses["right"][0, :3, 3])
    assert np.linalg.norm(left - right) == pytest.approx(wanted, abs=2e-4)


def test_cancel_keeps_the_jaws_closed(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """A stop in the air drops nothing."""
    executor = MotionExecutor(mock, robot)
    asked = _phase_start(half_fold, PhaseName.CARRY) + 1.0
    with pytest.raises(CancelledError):
        executor.run(half_fold, should_stop=_stop_at(executor, asked))
    last = {arm: width for _, arm, width in mock.gripper_commands}
    assert set(last.values()) == {robot.config.grasp.closed_width}


@pytest.mark.parametrize("share", [0.1, 0.35, 0.5, 0.7])
def test_next_command_works_after_a_cancel(
    half_fold: MotionPlan,
    planner: MotionPlanner,
    mock: MockRobot,
    robot: RobotModel,
    share: float,
) -> None:
    """From wherever a motion was stopped the arms go home, and the fold can run again."""
    executor = MotionExecutor(mock, robot)
    with pytest.raises(CancelledError):
        executor.run(half_fold, should_stop=_stop_at(executor, share * half_fold.duration))
    executor.run(planner.plan_home(mock.joint_positions(), open_hands=True))
    end = robot.arm_positions(ARMS, mock.joint_positions())
    assert end == pytest.approx(robot.rest_positions(ARMS), abs=1e-5)
    executor.run(half_fold)


def test_empty_jaws_are_noticed(half_fold: MotionPlan, mock: MockRobot, robot: RobotModel) -> None:
    """Jaws that close on nothing end the motion before the cloth is to be carried."""
    mock.holding_width = 0.0
    with pytest.raises(GraspFailedError, match="left and right"):
        MotionExecutor(mock, robot).run(half_fold)
    assert mock.now() < _phase_start(half_fold, PhaseName.CARRY) + 0.01


def test_cloth_lost_on_the_way_is_noticed(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Jaws that close on nothing while they carry end the motion before the release."""

    def lose(phase: PhaseName, progress: float) -> None:
        if phase is PhaseName.CARRY and progress > 0.5:
            mock.holding_width = 0.0
            mock.send_gripper("right", 0.0)

    with pytest.raises(ClothLostError, match="the right jaws.*slipped out"):
        MotionExecutor(mock, robot).run(half_fold, lose)
    assert mock.now() < _phase_start(half_fold, PhaseName.RELEASE) + 0.01


def test_wrong_start_is_noticed(half_fold: MotionPlan, mock: MockRobot, robot: RobotModel) -> None:
    """A plan made for another posture does not move anything."""
    mock.positions["LARM_JOINT1"] += 0.5
    with pytest.raises(TrackingError, match="LARM_JOINT1"):
        MotionExecutor(mock, robot).run(half_fold)
    assert mock.sent == []


class _Slipping(MockRobot):
    """Loses its right elbow a little at a time from some moment on."""

    slips_from = np.inf

    def read_joints(self) -> JointReading:
        measured = dict(super().read_joints().positions)
        measured["RARM_JOINT2"] += 0.2 * max(self.time - self.slips_from, 0.0)
        return JointReading(self.time, measured)


def test_lost_joint_is_noticed_and_held(half_fold: MotionPlan, robot: RobotModel) -> None:
    """A joint that leaves its trajectory stops everything and is named."""
    slipping = _Slipping(dict(robot.description.rest))
    slipping.slips_from = _phase_start(half_fold, PhaseName.CARRY) + 0.1
    with pytest.raises(TrackingError, match="RARM_JOINT2"):
        MotionExecutor(slipping, robot).run(half_fold)
    noticed = slipping.now() - slipping.slips_from
    assert noticed < 0.1 / 0.2 + 2 * robot.config.execution.monitor_period
    assert slipping._active == {}


def test_late_news_are_no_deviation(half_fold: MotionPlan, robot: RobotModel) -> None:
    """Positions that arrive late are compared with where the arms should have been then."""
    late = MockRobot(dict(robot.description.rest), reading_age=0.2)
    late.time = 1.0
    MotionExecutor(late, robot).run(half_fold)
    assert late.now() >= 1.0 + half_fold.duration


def test_end_that_is_not_reached_is_noticed(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """A robot that stays beside its goal is not taken to be there."""
    mock.tracking_offset = 0.03
    with pytest.raises(TrackingError, match="end"):
        MotionExecutor(mock, robot).run(half_fold)


def test_cancel_before_the_start_moves_nothing(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """A stop that was asked for beforehand comes before the first command."""
    with pytest.raises(CancelledError):
        MotionExecutor(mock, robot).run(half_fold, should_stop=lambda: True)
    assert mock.sent == [] and mock.gripper_commands == []


def test_late_start_is_allowed_for(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """With a start delay both arms begin at one later time, and a stop still works."""
    execution = replace(robot.config.execution, start_delay=0.1)
    executor = MotionExecutor(mock, robot, replace(robot.config, execution=execution))
    asked = _phase_start(half_fold, PhaseName.CARRY) + 1.5
    with pytest.raises(CancelledError):
        executor.run(half_fold, should_stop=_stop_at(executor, asked))
    assert mock.sent[0].start_time == pytest.approx(0.1)
    assert mock.now() - asked <= 0.4 + 0.1 + execution.monitor_period


def test_refused_manipulation_sends_nothing(
    planner: MotionPlanner, mock: MockRobot, towel, task
) -> None:
    """Out of reach is known before anything is sent to the robot."""
    with pytest.raises(CellError):
        planner.plan_motion(task([[-0.1, -0.2]], [0.0, 0.9]), towel(), mock.joint_positions())
    assert mock.sent == [] and mock.gripper_commands == []


def test_paused_arms_rest_and_go_on(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Paused for 2 s while they carry, the arms stand still on their path, then end as planned."""
    executor = MotionExecutor(mock, robot)
    begin = _phase_start(half_fold, PhaseName.CARRY) + 1.0
    rested: list[dict[str, float]] = []

    def pause() -> bool:
        if begin + 1.0 < mock.now() < begin + 2.0:
            rested.append(dict(mock.joint_positions()))
        return begin <= mock.now() < begin + 2.0

    executor.run(half_fold, should_pause=pause)
    assert len(rested) > 5 and all(posture == rested[0] for posture in rested)
    assert mock.now() > half_fold.duration + 1.5
    path = next(p for p in half_fold.phases if p.name is PhaseName.CARRY).segments[0].path
    curve = path.positions(np.linspace(0.0, path.length, 4000))
    for sent in mock.sent:
        if begin <= sent.start_time < begin + 4.0 and sent.group == "left_arm":
            gaps = np.abs(sent.trajectory.positions[:, None] - curve[None, :, :6]).max(axis=2)
            assert gaps.min(axis=1).max() < 1e-3
    end = robot.arm_positions(ARMS, mock.joint_positions())
    assert end == pytest.approx(robot.rest_positions(ARMS), abs=1e-5)


def test_a_paused_motion_can_be_cancelled(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """While the arms pause, a request to stop is heard."""
    executor = MotionExecutor(mock, robot)
    begin = _phase_start(half_fold, PhaseName.CARRY) + 1.0
    with pytest.raises(CancelledError):
        executor.run(half_fold, None, _stop_at(executor, begin + 3.0), lambda: mock.now() >= begin)
    assert mock.now() == pytest.approx(begin + 3.0, abs=0.2)


def test_a_pause_keeps_the_limits(
    half_fold: MotionPlan, mock: MockRobot, robot: RobotModel
) -> None:
    """Going on from rest keeps the velocities and accelerations of any motion."""
    begin = _phase_start(half_fold, PhaseName.CARRY) + 0.8
    MotionExecutor(mock, robot).run(
        half_fold, should_pause=lambda: begin <= mock.now() < begin + 1.0
    )
    resumed = [s for s in mock.sent if begin + 0.9 < s.start_time < begin + 1.3]
    assert resumed
    for sent in resumed:
        limits = MotionLimits.of(robot.max_velocity(sent.trajectory.joint_names))
        assert (np.abs(sent.trajectory.velocities) <= limits.velocity * 1.001).all()
        assert (np.abs(sent.trajectory.accelerations) <= limits.acceleration * 1.001).all()
