"""Carries out a motion plan phase by phase on any robot, and can be stopped at any moment."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan, Phase, PhaseName
from emd_arm_executor.robot_interface import RobotInterface
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.trajectory import TimedPath, stop_path
from emd_core.errors import CancelledError, GraspFailedError, TrackingError

Feedback = Callable[[PhaseName, float], None]
ShouldStop = Callable[[], bool]


class MotionExecutor:
    """Runs one plan at a time: sends each segment, watches it, stops it when asked.

    Jaws move only where the plan says so: a cancelled or failed motion leaves them as they are,
    so that nothing falls. After any end the arms stand still and the next plan can run; plans
    start from wherever the arms are.
    """

    def __init__(
        self, robot: RobotInterface, model: RobotModel, config: MotionConfig | None = None
    ) -> None:
        """Connect a robot with its model.

        Args:
            robot: The robot that moves.
            model: Its model: joints, groups and speeds.
            config: How it is watched; the model's own if None.
        """
        self.robot = robot
        self.model = model
        self.config = config or model.config

    def run(
        self,
        plan: MotionPlan,
        on_feedback: Feedback | None = None,
        should_stop: ShouldStop | None = None,
    ) -> None:
        """Carry out a plan from its first phase to its last.

        Args:
            plan: Planned from where the arms are now.
            on_feedback: Called with the phase and how far it is, 0..1, at every look.
            should_stop: Asked at every look; True brings the arms to rest on their path.

        Raises:
            CancelledError: If `should_stop` said so; the arms are at rest.
            TrackingError: If the arms are not where the plan begins, or leave a trajectory.
            GraspFailedError: If the jaws close on nothing; they stay closed.
        """
        feedback = on_feedback or (lambda phase, progress: None)
        asked = should_stop or (lambda: False)
        for phase in plan.phases:
            feedback(phase.name, 0.0)
            self._run_phase(phase, feedback, asked)
            if phase.name is PhaseName.GRASP:
                self._check_grasp(phase)
            feedback(phase.name, 1.0)

    def _run_phase(self, phase: Phase, feedback: Feedback, asked: ShouldStop) -> None:
        self._check_asked(phase.name, asked)
        for command in phase.gripper:
            self.robot.send_gripper(command.arm, command.width)
        done = 0.0
        for segment in phase.segments:
            self._check_asked(phase.name, asked)
            share = segment.duration / max(phase.duration, 1e-9)
            self._run_segment(phase.name, segment, (done, share), feedback, asked)
            done += share
        end = self.robot.now() + phase.pause
        while (now := self.robot.now()) < end - 1e-9:
            self._check_asked(phase.name, asked)
            feedback(phase.name, 1.0 - (end - now) / max(phase.duration, 1e-9))
            self.robot.wait_until(min(end, now + self.config.execution.monitor_period))

    def _check_asked(self, name: PhaseName, asked: ShouldStop) -> None:
        """Stop between two motions, where nothing moves."""
        if asked():
            raise CancelledError(
                f"stopped at '{name}' as asked; the arms are at rest and the jaws as they were"
            )

    def _run_segment(
        self,
        name: PhaseName,
        segment: TimedPath,
        span: tuple[float, float],
        feedback: Feedback,
        asked: ShouldStop,
    ) -> None:
        """Follow one segment from rest to rest; `span` is its begin and share in the phase."""
        trajectory = segment.sample(self.config.timing.sample_period)
        self._check_start(name, trajectory)
        start = self.robot.now() + self.config.execution.start_delay
        self._send(trajectory, start)
        while (elapsed := self.robot.now() - start) < trajectory.duration - 1e-9:
            if asked():
                self._stop(segment, start)
                raise CancelledError(
                    f"stopped during '{name}' at {elapsed:.1f} of {trajectory.duration:.1f} s as "
                    "asked; the arms are at rest and the jaws as they were"
                )
            self._check_tracking(name, segment, trajectory, start)
            feedback(name, span[0] + span[1] * max(elapsed, 0.0) / trajectory.duration)
            next_look = self.robot.now() + self.config.execution.monitor_period
            self.robot.wait_until(min(next_look, start + trajectory.duration))
        self._settle(name, trajectory)

    def _send(self, trajectory: JointTrajectory, start: float) -> None:
        """Split a trajectory among the joint groups of its arms."""
        for group, joints in self.model.description.controllers.items():
            if set(joints) <= set(trajectory.joint_names):
                self.robot.send_trajectory(group, trajectory.select(joints), start)

    def _stop(self, segment: TimedPath, start: float) -> None:
        """Come to rest on the path, as fast as the limits for stopping allow."""
        now = self.robot.now()
        names = segment.path.joint_names
        limits = MotionLimits.for_stop(self.model.max_velocity(names), self.config.timing)
        ahead = self.config.execution.start_delay
        stop = stop_path(segment, now + ahead - start, limits)
        trajectory = stop.sample(self.config.timing.sample_period)
        self._send(trajectory, now + ahead)
        self.robot.wait_until(now + ahead + trajectory.duration)

    @staticmethod
    def _deviation(
        trajectory: JointTrajectory, time: float, measured: Mapping[str, float]
    ) -> tuple[float, str]:
        """Give the largest deviation from a trajectory, radians, and the joint that has it."""
        wanted = trajectory.sample(time)
        gaps = {
            name: abs(measured[name] - value)
            for name, value in zip(trajectory.joint_names, wanted, strict=True)
        }
        worst = max(gaps, key=lambda name: gaps[name])
        return float(gaps[worst]), worst

    def _check_start(self, name: PhaseName, trajectory: JointTrajectory) -> None:
        gap, joint = self._deviation(trajectory, 0.0, self.robot.joint_positions())
        if gap > self.config.execution.tracking_tolerance:
            raise TrackingError(
                f"'{name}' should begin within {self.config.execution.tracking_tolerance:.2f} rad "
                f"of the arms' posture, {joint} is {gap:.2f} rad away; plan again from here"
            )

    def _check_tracking(
        self, name: PhaseName, segment: TimedPath, trajectory: JointTrajectory, start: float
    ) -> None:
        # Where the arms should have been when they were measured: the news may be late.
        reading = self.robot.read_joints()
        gap, joint = self._deviation(trajectory, reading.time - start, reading.positions)
        if gap > self.config.execution.tracking_tolerance:
            self.robot.hold()
            raise TrackingError(
                f"{joint} should follow '{name}' within "
                f"{self.config.execution.tracking_tolerance:.2f} rad, it is {gap:.2f} rad off; "
                "look for an obstacle or a stopped drive, then send the arms home"
            )

    def _settle(self, name: PhaseName, trajectory: JointTrajectory) -> None:
        """Wait until the arms have reached the end, no longer than the settling time."""
        tolerance = self.config.execution.end_tolerance
        deadline = self.robot.now() + self.config.execution.settle_time
        while True:
            positions = self.robot.joint_positions()
            gap, joint = self._deviation(trajectory, trajectory.duration, positions)
            if gap <= tolerance:
                return
            now = self.robot.now()
            if now >= deadline:
                raise TrackingError(
                    f"'{name}' should end within {tolerance:.3f} rad, {joint} is "
                    f"{gap:.3f} rad off after {self.config.execution.settle_time} s"
                )
            self.robot.wait_until(min(deadline, now + self.config.execution.monitor_period / 5))

    def _check_grasp(self, phase: Phase) -> None:
        empty = [
            command.arm
            for command in phase.gripper
            if self.robot.gripper_width(command.arm) < self.config.execution.holding_width
        ]
        if empty:
            raise GraspFailedError(
                f"the {' and '.join(empty)} jaws should hold cloth, they closed on nothing; look "
                "at the hem again and grasp anew"
            )
