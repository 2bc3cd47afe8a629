"""Carries out a motion plan phase by phase on any robot, and can be stopped at any moment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan, Phase, PhaseName
from emd_arm_executor.robot_interface import RobotInterface
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.trajectory import TimedPath, resume_path, stop_path
from emd_core.errors import CancelledError, GraspFailedError, TrackingError

Feedback = Callable[[PhaseName, float], None]
ShouldStop = Callable[[], bool]


@dataclass(frozen=True)
class _Watch:
    """Who is told how far a motion is, and who is asked whether it should go on."""

    feedback: Feedback
    stop: ShouldStop
    pause: ShouldStop


class ClothLostError(GraspFailedError):
    """Cloth slipped out of the jaws, so that it lies neither where it was nor where it should."""


class MotionExecutor:
    """Runs one plan at a time: sends each segment, watches it, pauses and stops it when asked.

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
        should_pause: ShouldStop | None = None,
    ) -> None:
        """Carry out a plan from its first phase to its last.

        Args:
            plan: Planned from where the arms are now.
            on_feedback: Called with the phase and how far it is, 0..1, at every look.
            should_stop: Asked at every look; True brings the arms to rest on their path.
            should_pause: Asked likewise; while it says True the arms rest on their path with the
                jaws as they are, then they go on. `should_stop` is heard meanwhile.

        Raises:
            CancelledError: If `should_stop` said so; the arms are at rest.
            TrackingError: If the arms are not where the plan begins, or leave a trajectory.
            GraspFailedError: If the jaws close on nothing; they stay closed.
            ClothLostError: If cloth slipped out of them while they carried it.
        """
        watch = _Watch(
            on_feedback or (lambda phase, progress: None),
            should_stop or (lambda: False),
            should_pause or (lambda: False),
        )
        closed: list[str] = []
        for phase in plan.phases:
            watch.feedback(phase.name, 0.0)
            self._run_phase(phase, watch)
            if phase.name is PhaseName.GRASP:
                closed = [command.arm for command in phase.gripper]
                self._check_grasp(closed)
            if phase.name is PhaseName.CARRY:
                self._check_kept(closed)
            watch.feedback(phase.name, 1.0)

    def _run_phase(self, phase: Phase, watch: _Watch) -> None:
        self._check_asked(phase.name, watch)
        for command in phase.gripper:
            self.robot.send_gripper(command.arm, command.width)
        done = 0.0
        for segment in phase.segments:
            self._check_asked(phase.name, watch)
            share = segment.duration / max(phase.duration, 1e-9)
            self._run_segment(phase.name, segment, (done, share), watch)
            done += share
        end = self.robot.now() + phase.pause
        while (now := self.robot.now()) < end - 1e-9:
            self._check_asked(phase.name, watch)
            watch.feedback(phase.name, 1.0 - (end - now) / max(phase.duration, 1e-9))
            self.robot.wait_until(min(end, now + self.config.execution.monitor_period))

    def _check_asked(self, name: PhaseName, watch: _Watch) -> None:
        """Stop or pause where nothing moves."""
        while True:
            if watch.stop():
                raise CancelledError(
                    f"stopped at '{name}' as asked; the arms are at rest and the jaws as they were"
                )
            if not watch.pause():
                return
            self.robot.wait_until(self.robot.now() + self.config.execution.monitor_period)

    def _run_segment(
        self, name: PhaseName, segment: TimedPath, span: tuple[float, float], watch: _Watch
    ) -> None:
        """Follow one segment from rest to rest; `span` is its begin and share in the phase."""
        trajectory, start = self._start(name, segment)
        while self.robot.now() - start < trajectory.duration - 1e-9:
            if watch.stop():
                self._stop(segment, start)
                raise CancelledError(
                    f"stopped during '{name}' as asked; the arms are at rest and the jaws as they "
                    "were"
                )
            if watch.pause():
                stopped = self._stop(segment, start)
                self._check_asked(name, watch)
                segment = self._rest_of(stopped)
                trajectory, start = self._start(name, segment)
                continue
            self._check_tracking(name, trajectory, start)
            covered = segment.state_at(self.robot.now() - start).position / segment.path.length
            watch.feedback(name, span[0] + span[1] * min(max(covered, 0.0), 1.0))
            next_look = self.robot.now() + self.config.execution.monitor_period
            self.robot.wait_until(min(next_look, start + trajectory.duration))
        self._settle(name, trajectory)

    def _start(self, name: PhaseName, segment: TimedPath) -> tuple[JointTrajectory, float]:
        """Send a segment; give it as sent and when it starts."""
        trajectory = segment.sample(self.config.timing.sample_period)
        self._check_start(name, trajectory)
        start = self.robot.now() + self.config.execution.start_delay
        self._send(trajectory, start)
        return trajectory, start

    def _send(self, trajectory: JointTrajectory, start: float) -> None:
        """Split a trajectory among the joint groups of its arms."""
        for group, joints in self.model.description.controllers.items():
            if set(joints) <= set(trajectory.joint_names):
                self.robot.send_trajectory(group, trajectory.select(joints), start)

    def _stop(self, segment: TimedPath, start: float) -> TimedPath:
        """Come to rest on the path, as fast as the limits for stopping allow."""
        now = self.robot.now()
        speeds = self.model.max_velocity(segment.path.joint_names)
        limits = MotionLimits.for_stop(speeds, self.config.timing)
        ahead = self.config.execution.start_delay
        stop = stop_path(segment, now + ahead - start, limits)
        trajectory = stop.sample(self.config.timing.sample_period)
        self._send(trajectory, now + ahead)
        self.robot.wait_until(now + ahead + trajectory.duration)
        return stop

    def _rest_of(self, stopped: TimedPath) -> TimedPath:
        """Time what is left of a path on which the arms came to rest."""
        speeds = self.model.max_velocity(stopped.path.joint_names)
        return resume_path(stopped, MotionLimits.of(speeds, self.config.timing))

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

    def _check_tracking(self, name: PhaseName, trajectory: JointTrajectory, start: float) -> None:
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

    def _check_grasp(self, arms: Sequence[str]) -> None:
        empty = self._empty(arms)
        if empty:
            raise GraspFailedError(
                f"the {' and '.join(empty)} jaws should hold cloth, they closed on nothing; look "
                "at the hem again and grasp anew"
            )

    def _check_kept(self, arms: Sequence[str]) -> None:
        lost = self._empty(arms)
        if lost:
            raise ClothLostError(
                f"the {' and '.join(lost)} jaws should have kept the cloth, it slipped out on the "
                "way; look at it and plan anew, more slowly or with shorter displacements"
            )

    def _empty(self, arms: Sequence[str]) -> list[str]:
        """Name the arms whose closed jaws have nothing between them."""
        least = self.config.execution.holding_width
        return [arm for arm in arms if self.robot.gripper_width(arm) < least]
