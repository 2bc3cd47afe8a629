"""From grips and a displacement to joint paths of one or two arms, all in reach or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.grasp import GraspPose, share_displacement
from emd_arm_executor.joint_path import JointPath, travel_parameters
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_arm_executor.via_poses import OrientedPoint, carry_poses, line_poses
from emd_core.frames import FloatArray, inverse_transform


@dataclass(frozen=True)
class Grip:
    """One arm at one hem.

    Attributes:
        arm: Name of the arm.
        grasp: How its hand stands.
        positions: Its joints in this posture, shape (n,), radians.
        pre_grasp_distance: Distance outside the hem at which the hand is lowered, metres.
    """

    arm: str
    grasp: GraspPose
    positions: FloatArray
    pre_grasp_distance: float = 0.0


@dataclass(frozen=True)
class HandPaths:
    """Joint paths of the hands at the cloth, all arms on one parameter.

    Attributes:
        arms: The arms in the order of the joints.
        lower: From above the table to beside the hem.
        insert: From there to the grip.
        carry: From the grip to the release.
        retreat: From the release upwards.
        via_poses_in_table: Poses of the tools while they carry, shape (H, N, 4, 4).
    """

    arms: tuple[str, ...]
    lower: JointPath
    insert: JointPath
    carry: JointPath
    retreat: JointPath
    via_poses_in_table: FloatArray

    @property
    def start(self) -> FloatArray:
        """Joint positions above the table before the grasp, shape (n,), radians."""
        return self.lower.positions(0.0)

    @property
    def end(self) -> FloatArray:
        """Joint positions above the table after the release, shape (n,), radians."""
        return self.retreat.positions(self.retreat.length)


def hand_paths(
    robot: RobotModel,
    grips: Sequence[Grip],
    displacements_in_table: FloatArray,
    silhouette: Silhouette,
    config: MotionConfig,
) -> HandPaths:
    """Find joint paths for the whole contact with the cloth.

    Args:
        robot: The robot.
        grips: One for each arm that is used.
        displacements_in_table: Of each hand, shape (H, 2), metres.
        silhouette: The cloth, for its height.
        config: Heights and steps.

    Raises:
        OutOfReachError: If an arm cannot follow.
        InvalidInputError: If a displacement is too short.
    """
    down = descent_poses(grips, silhouette, config)
    onward = carrying_poses(grips, displacements_in_table, silhouette, config)
    names = robot.joint_names([grip.arm for grip in grips])
    descents = [follow_descent(robot, g, [p[h] for p in down]) for h, g in enumerate(grips)]
    carries = [follow_carrying(robot, g, [p[h] for p in onward]) for h, g in enumerate(grips)]
    lower, insert, carry, retreat = (
        JointPath.through(
            names,
            np.concatenate([positions[part] for positions in parts], axis=1),
            travel_parameters(poses[part]),
        )
        for parts, poses in ((descents, down), (carries, onward))
        for part in (0, 1)
    )
    arms = tuple(grip.arm for grip in grips)
    return HandPaths(arms, lower, insert, carry, retreat, onward[0])


def descent_poses(
    grips: Sequence[Grip], silhouette: Silhouette, config: MotionConfig
) -> tuple[FloatArray, FloatArray]:
    """Lay the hands' ways down beside the hem and under it.

    Returns:
        Poses while lowering and while inserting, each of shape (H, N, 4, 4), table frame.
    """
    hover = max(silhouette.top, config.grasp.grip_height) + config.grasp.hover_clearance
    rise = hover - config.grasp.grip_height
    held = np.stack([grip.grasp.transform_tool_to_table for grip in grips])
    beside = np.stack([_drawn_back(grip, 0.0, config) for grip in grips])
    above = np.stack([_drawn_back(grip, rise, config) for grip in grips])
    return line_poses(above, beside, config.path), line_poses(beside, held, config.path)


def carrying_poses(
    grips: Sequence[Grip],
    displacements_in_table: FloatArray,
    silhouette: Silhouette,
    config: MotionConfig,
) -> tuple[FloatArray, FloatArray]:
    """Lay the hands' ways from the grip to the release and up from there.

    Hands that share one displacement hang on an oriented point between them. They keep their pose
    relative to it, so relative to each other, from the grip to the release (paper, IV-B items 3
    and 4). Others have an oriented point each; they set out and arrive together.

    Returns:
        Poses while carrying and while retreating, each of shape (H, N, 4, 4), table frame.
    """
    held = np.stack([grip.grasp.transform_tool_to_table for grip in grips])
    groups = np.arange(len(held))[:, None]
    if share_displacement(displacements_in_table):
        groups = groups.T
    ways = [_way(held[g], displacements_in_table[g[0]], silhouette, config) for g in groups]
    points = [carry_poses(*way, config.path) for way in ways]
    count = max(len(point) for point in points)
    carried = np.empty((len(held), count, 4, 4))
    for group, way, point in zip(groups, ways, points, strict=True):
        if len(point) < count:
            point = carry_poses(*way, config.path, count)
        relative = inverse_transform(point[0]) @ held[group]
        carried[group] = np.einsum("nij,hjk->hnik", point, relative)
    up = carried[:, -1].copy()
    up[:, 2, 3] = np.maximum(up[:, 2, 3], config.path.retreat_height)
    return carried, line_poses(carried[:, -1], up, config.path)


def follow_descent(
    robot: RobotModel, grip: Grip, poses: Sequence[FloatArray], max_step: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Find one arm's joints while lowering and inserting, from the grip backwards.

    Args:
        robot: The robot.
        grip: The arm and its gripping posture.
        poses: Lowering and insertion of this hand, each (N, 4, 4), table frame.
        max_step: Largest change of a joint between poses, radians; as configured if None.

    Raises:
        OutOfReachError: If the arm cannot follow.
    """
    arm, to_base = robot.arms[grip.arm], robot.transform_table_to_base
    insert = follow_poses(arm, to_base @ poses[1][::-1], grip.positions, max_step)[::-1]
    return follow_poses(arm, to_base @ poses[0][::-1], insert[0], max_step)[::-1], insert


def follow_carrying(
    robot: RobotModel, grip: Grip, poses: Sequence[FloatArray], max_step: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Find one arm's joints while carrying and retreating; arguments as for `follow_descent`."""
    arm, to_base = robot.arms[grip.arm], robot.transform_table_to_base
    carry = follow_poses(arm, to_base @ poses[0], grip.positions, max_step)
    return carry, follow_poses(arm, to_base @ poses[1], carry[-1], max_step)


def _way(
    held: FloatArray, displacement: FloatArray, silhouette: Silhouette, config: MotionConfig
) -> tuple[OrientedPoint, OrientedPoint]:
    """Give the oriented point between hands (H, 4, 4) that move alike, at grip and release."""
    centre = held[:, :3, 3].mean(axis=0)
    height = _release_height(held, displacement, silhouette, config)
    return OrientedPoint(centre), OrientedPoint(np.array([*(centre[:2] + displacement), height]))


def _drawn_back(grip: Grip, rise: float, config: MotionConfig) -> FloatArray:
    """Give the hand's pose outside the hem, measured from the hem, not from the grip."""
    return grip.grasp.at(grip.pre_grasp_distance + config.grasp.insertion, rise)


def _release_height(
    held: FloatArray, displacement: FloatArray, silhouette: Silhouette, config: MotionConfig
) -> float:
    """Let go a little above whatever lies where any of the hands lets go, never below the grip."""
    below = max(
        silhouette.height_near(pose[:2, 3] + displacement, config.path.release_radius)
        for pose in held
    )
    return max(below, config.grasp.grip_height) + config.path.release_clearance
