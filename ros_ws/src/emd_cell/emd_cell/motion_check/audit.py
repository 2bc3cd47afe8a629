"""Looks at a planned motion from outside: limits, collisions, straightness, hands together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from emd_arm_executor.config import PathConfig
from emd_arm_executor.kinematics import ArmKinematics
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan, Phase, PhaseName
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.trajectory import TimedPath
from emd_arm_executor.via_poses import OrientedPoint, carry_poses
from emd_core.frames import FloatArray, inverse_transform

# Distance that no joint's origin and no tool moves farther between two collision checks, metres.
SAMPLING = 1e-3
_TIME_STEP = 2e-3
# Spacing of the ideal paths' points, metres; half of it is how much a deviation is overrated.
_FINE = 5e-5
# Farther than this from the torso's axis nothing of the robot reaches, metres.
_TORSO_RADIUS = 0.9


@dataclass
class Audit:
    """The worst of a motion; ratios above 1 break a limit.

    Attributes:
        position: Joint positions: how far beyond a limit, radians; negative inside.
        velocity: Largest ratio to the limit.
        acceleration: Largest ratio to the limit.
        jerk: Largest ratio to the limit.
        contacts: Pairs that come nearer than their margin less `CollisionConfig.slack`.
        clearance_mm: Least distance of any pair beyond its margin, millimetres.
        checked: How many configurations were checked for collisions.
        deviation_mm: Of a carrying or straight path from its ideal, millimetres.
        deviation_deg: Of the hand's rotation, degrees.
        apart_mm: Change of the distance vector between two carrying hands, millimetres.
        jump: Largest gap of a joint between two segments, radians.
    """

    position: float = -np.inf
    velocity: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    contacts: tuple[str, ...] = ()
    clearance_mm: float = np.inf
    checked: int = 0
    deviation_mm: float = 0.0
    deviation_deg: float = 0.0
    apart_mm: float = 0.0
    jump: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether every limit holds and nothing touches."""
        ratios = max(self.velocity, self.acceleration, self.jerk)
        return (
            self.position <= 1e-6
            and ratios <= 1.0 + 1e-3
            and not self.contacts
            and self.deviation_mm <= 0.5
            and self.deviation_deg <= 0.2
            and self.apart_mm <= 0.2
            and self.jump <= 1e-6
        )

    def as_entry(self) -> dict[str, object]:
        """Give the values for JSON."""
        return asdict(self)


def audit_motion(robot: RobotModel, plan: MotionPlan, start: Mapping[str, float]) -> Audit:
    """Check every segment of a motion, the one after the other.

    Args:
        robot: The robot, its torso at rest.
        plan: The motion.
        start: Positions of all joints where it begins, radians.
    """
    audit, posture = Audit(), dict(start)
    widths: dict[str, float] = {}
    for phase in plan.phases:
        widths.update({command.arm: command.width for command in phase.gripper})
        for index, segment in enumerate(phase.segments):
            _audit_limits(robot, segment, posture, audit)
            _audit_contacts(robot, segment, posture, widths, audit)
            if _is_guided(phase, index):
                _audit_line(robot, segment, posture, phase.name is PhaseName.CARRY, audit)
            end = segment.path.positions(segment.path.length)
            posture.update(zip(segment.path.joint_names, end.tolist(), strict=True))
    return audit


def _is_guided(phase: Phase, index: int) -> bool:
    """Whether a segment follows a line: carrying, retreat, and an approach's last two."""
    if phase.name is PhaseName.APPROACH:
        return index >= len(phase.segments) - 2
    return phase.name in (PhaseName.CARRY, PhaseName.RETREAT)


def _audit_limits(
    robot: RobotModel, segment: TimedPath, posture: Mapping[str, float], audit: Audit
) -> None:
    names = segment.path.joint_names
    times = np.linspace(0.0, segment.duration, int(segment.duration / _TIME_STEP) + 2)
    q, v, a, j = segment.joint_motion(times)
    lower, upper = robot.position_limits(names)
    limits = MotionLimits.of(robot.max_velocity(names), robot.config.timing)
    velocity, acceleration, jerk = limits.excess(v, a, j)
    audit.position = max(audit.position, float(np.maximum(lower - q, q - upper).max()))
    audit.velocity = max(audit.velocity, velocity)
    audit.acceleration = max(audit.acceleration, acceleration)
    audit.jerk = max(audit.jerk, jerk)
    gaps = np.abs(q[0] - [posture[name] for name in names])
    audit.jump = max(audit.jump, float(gaps.max()))


def _audit_contacts(
    robot: RobotModel,
    segment: TimedPath,
    posture: Mapping[str, float],
    widths: Mapping[str, float],
    audit: Audit,
) -> None:
    positions = segment.path.positions(_parameters(robot, segment, posture))
    rows = robot.configurations(posture, segment.path.joint_names, positions, widths)
    audit.checked += len(rows)
    clearances = np.min([robot.collision.clearances(q) for q in rows], axis=0)
    audit.clearance_mm = min(audit.clearance_mm, float(clearances.min()) * 1e3)
    touching = robot.collision.nearer_than(clearances, -robot.config.collision.slack)
    audit.contacts = tuple(sorted({*audit.contacts, *map(str, touching)}))


def _parameters(robot: RobotModel, segment: TimedPath, posture: Mapping[str, float]) -> FloatArray:
    """Choose parameters between which no joint's origin and no tool moves beyond SAMPLING."""
    path = segment.path
    coarse = np.linspace(0.0, path.length, 201)
    positions = path.positions(coarse)
    travel = np.abs(np.diff(positions, axis=0)).max(axis=1) * _TORSO_RADIUS
    arms = _arms(robot, segment, posture)
    if arms:
        moves = [
            np.linalg.norm(np.diff(arm.chain.points(positions[:, columns]), axis=0), axis=2)
            for arm, columns in arms
        ]
        travel = np.max([move.max(axis=1) for move in moves], axis=0)
    travelled = np.append(0.0, np.cumsum(np.maximum(travel, 1e-12)))
    count = int(np.ceil(travelled[-1] / SAMPLING)) + 1
    return np.interp(np.linspace(0.0, travelled[-1], count + 1), travelled, coarse)


def _arms(
    robot: RobotModel, segment: TimedPath, posture: Mapping[str, float]
) -> list[tuple[ArmKinematics, list[int]]]:
    """List the arms that a segment moves and the columns of their joints."""
    torso = robot.description.torso
    turned = robot.at_torso(posture[torso.joint_name]) if torso else robot
    names = segment.path.joint_names
    return [
        (arm, [names.index(name) for name in arm.group.joint_names])
        for arm in turned.arms.values()
        if set(arm.group.joint_names) <= set(names)
    ]


def _audit_line(
    robot: RobotModel,
    segment: TimedPath,
    posture: Mapping[str, float],
    carries: bool,
    audit: Audit,
) -> None:
    positions = segment.path.positions(np.linspace(0.0, segment.path.length, 400))
    to_table = inverse_transform(robot.transform_table_to_base)
    poses = np.stack(
        [
            to_table @ arm.chain.forward(positions[:, k])
            for arm, k in _arms(robot, segment, posture)
        ]
    )
    points = poses[..., :3, 3]
    # Carrying hands follow their middle; else each hand has a line of its own.
    together = points.mean(axis=0)[[0, -1]]
    for hand in range(len(poses)):
        ends = together if carries else points[hand, [0, -1]]
        ideal = _ideal(ends, robot.config.path, carries)
        wanted = points[hand, 0] + ideal - ideal[0]
        gap = float(cKDTree(wanted).query(points[hand])[0].max()) * 1e3
        turns = Rotation.from_matrix(poses[hand, 0, :3, :3].T @ poses[hand, :, :3, :3])
        turn = float(np.rad2deg(turns.magnitude().max()))
        audit.deviation_mm = max(audit.deviation_mm, gap)
        audit.deviation_deg = max(audit.deviation_deg, turn)
    if carries:
        apart = points[-1] - points[0]
        change = float(np.linalg.norm(apart - apart[0], axis=1).max()) * 1e3
        audit.apart_mm = max(audit.apart_mm, change)


def _ideal(ends: FloatArray, config: PathConfig, carries: bool) -> FloatArray:
    """Draw the line or the carrying path between two points (2, 3) finely, shape (N, 3)."""
    if not carries:
        count = int(np.linalg.norm(ends[1] - ends[0]) / _FINE) + 2
        return np.linspace(ends[0], ends[1], count)
    fine = replace(config, linear_step=_FINE)
    return carry_poses(OrientedPoint(ends[0]), OrientedPoint(ends[1]), fine)[:, :3, 3]
