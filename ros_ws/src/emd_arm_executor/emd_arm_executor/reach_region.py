"""The part of the table in which a hand can grasp and lift, for the planner's reach limit.

The paper pushes grasp and release points into an area that roughly matches the robot's range of
motion (V-B); this computes such an area for each arm.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from emd_arm_executor.grasp import GraspPose
from emd_arm_executor.hem import Hem
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import OutOfReachError
from emd_core.frames import FloatArray

# Directions in which an unreachable point may be cut off.
_CUTS = 72


def reach_region(robot: RobotModel, arm: str, lift_height: float | None = None) -> FloatArray:
    """Compute the convex polygon in which a vertical hand can grasp and be raised.

    The table is sampled on a grid. A point counts if the arm takes the gripping posture there,
    follows straight up to the lift height and touches nothing on the way, with the jaws along x
    or along y of the table frame. Of the points that count, the polygon is the convex hull after
    what surrounds points that do not count has been cut off.

    Args:
        robot: The robot.
        arm: Name of the arm.
        lift_height: Height to which the hand must rise, metres; the path's own if None.

    Returns:
        Corners, counter-clockwise in the axes of the table frame, shape (N, 2), metres.

    Raises:
        OutOfReachError: If the arm reaches no area of the table.
    """
    height = robot.config.path.lift_height if lift_height is None else lift_height
    reach = robot.config.reach
    axis = np.arange(-reach.extent, reach.extent + reach.step / 2.0, reach.step)
    reachable = np.zeros((len(axis), len(axis)), dtype=bool)
    seed = robot.rest_positions([arm])
    for i, x in enumerate(axis):
        # Back and forth, so that each point is next to the one before and its posture a good seed.
        for j in range(len(axis)) if i % 2 == 0 else reversed(range(len(axis))):
            found = _posture(robot, arm, np.array([x, axis[j]]), height, seed)
            if found is not None:
                reachable[i, j], seed = True, found
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    return _convex_inside(arm, grid[reachable], grid[~reachable])


def _posture(
    robot: RobotModel, arm: str, point: FloatArray, height: float, seed: FloatArray
) -> FloatArray | None:
    """Give joint positions of a grip from which the hand can be raised, or None."""
    kinematics, grasp = robot.arms[arm], robot.config.grasp
    steps = np.arange(0.0, height - grasp.grip_height + 1e-9, robot.config.reach.lift_step)
    rises = np.append(steps, height - grasp.grip_height)
    for direction in (np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        hem = Hem(point, -direction, 0.0, True, (0, 0))
        pose = GraspPose(hem, np.array([*point, grasp.grip_height]), direction)
        poses = robot.transform_table_to_base @ np.stack([pose.at(0.0, rise) for rise in rises])
        restarts = robot.config.kinematics.grasp_restarts
        for positions in kinematics.solutions(poses[0], (seed,), restarts):
            try:
                path = follow_poses(kinematics, poses, positions)
            except OutOfReachError:
                continue
            widths = {arm: grasp.closed_width}
            rows = robot.configurations({}, robot.joint_names([arm]), path, widths)
            if all(robot.collision.contact(q) is None for q in rows):
                return positions
    return None


def _convex_inside(arm: str, inside: FloatArray, outside: FloatArray) -> FloatArray:
    """Find a large convex polygon of the inside points that holds no outside point."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CUTS, endpoint=False)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    while True:
        try:
            hull = ConvexHull(inside)
        except (QhullError, ValueError) as err:
            raise OutOfReachError(
                f"the {arm} arm should reach an area of the table, it reaches {len(inside)} "
                "points of the grid; move the table nearer"
            ) from err
        facets = hull.equations
        depth = (facets[:, :2] @ outside.T + facets[:, 2:]).max(axis=0) if len(outside) else []
        wrong = np.asarray(depth) < -1e-9
        if not wrong.any():
            return np.asarray(inside[hull.vertices])
        deepest = outside[int(np.argmin(depth))]
        kept = (inside - deepest) @ normals.T < -1e-9
        inside = inside[kept[:, int(np.argmax(kept.sum(axis=0)))]]
