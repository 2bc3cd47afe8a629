"""A motion that has been computed and checked, ready to be carried out phase by phase."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from emd_arm_executor.grasp import GraspPose
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.trajectory import TimedPath
from emd_core.frames import FloatArray


class PhaseName(StrEnum):
    """What happens in a phase, in the order of a manipulation."""

    APPROACH = "approach"
    GRASP = "grasp"
    CARRY = "carry"
    RELEASE = "release"
    RETREAT = "retreat"
    HOME = "home"


@dataclass(frozen=True)
class GripperCommand:
    """Tell one hand how far to open.

    Attributes:
        arm: Name of the arm.
        width: Opening of the jaws, metres.
    """

    arm: str
    width: float


@dataclass(frozen=True)
class Phase:
    """A part of the motion: jaws are told first, then the segments run, then a pause.

    Attributes:
        name: What happens.
        segments: Motions from rest to rest, one after the other; each starts where the one before
            ended.
        gripper: Sent when the phase begins.
        pause: Time after the last segment, for the jaws to close or open, seconds.
    """

    name: PhaseName
    segments: tuple[TimedPath, ...] = ()
    gripper: tuple[GripperCommand, ...] = ()
    pause: float = 0.0

    @property
    def duration(self) -> float:
        """Length of the phase, seconds."""
        return sum(segment.duration for segment in self.segments) + self.pause

    def trajectories(self, period: float) -> list[JointTrajectory]:
        """Sample the segments every `period` seconds."""
        return [segment.sample(period) for segment in self.segments]


@dataclass(frozen=True)
class MotionPlan:
    """Everything that the arms will do for one manipulation, or to go home.

    Attributes:
        phases: In their order.
        grasps: How each used arm grips.
        via_poses_in_table: Poses of each used arm's tool while it carries, shape (N, 4, 4).
        displacements_in_table: Displacement of each used arm's hand, after its correction for the
            grips, shape (2,), metres.
        rejected: Why candidates before the chosen ones were given up, in their order.
    """

    phases: tuple[Phase, ...]
    grasps: Mapping[str, GraspPose] = field(default_factory=dict)
    via_poses_in_table: Mapping[str, FloatArray] = field(default_factory=dict)
    displacements_in_table: Mapping[str, FloatArray] = field(default_factory=dict)
    rejected: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Length of the motion, seconds."""
        return sum(phase.duration for phase in self.phases)
