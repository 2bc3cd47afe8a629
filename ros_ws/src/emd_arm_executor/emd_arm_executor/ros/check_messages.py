"""What a motion plan says about a manipulation, as messages hold it."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point32, Polygon, Vector3
from std_msgs.msg import Header

from emd_arm_executor.grasp import share_displacement
from emd_arm_executor.motion_plan import MotionPlan
from emd_core.independent_manipulation import HandsManipulation, IndependentManipulation
from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_msgs_py.srv import CheckManipulation


def executed_manipulation(plan: MotionPlan) -> HandsManipulation:
    """Give the manipulation with the points at the hem and the directions the hands take."""
    points, displacements, directions = (np.full((2, 2), np.nan) for _ in range(3))
    for row, (arm, grasp) in enumerate(plan.grasps.items()):
        points[row] = grasp.held_point_in_table[:2]
        displacements[row] = plan.displacements_in_table[arm]
        directions[row] = grasp.direction
    if share_displacement(displacements[: len(plan.grasps)]):
        return Manipulation(points, displacements[0], directions)
    return IndependentManipulation(points, displacements, directions)


def fill_check(
    response: CheckManipulation.Response, plan: MotionPlan, header: Header
) -> CheckManipulation.Response:
    """Describe a motion that could be carried out."""
    executed = executed_manipulation(plan)
    response.executed = conversions.manipulation_to_message(executed, header)
    response.arms = list(plan.grasps)
    response.grasp_directions = [
        Vector3(x=float(grasp.direction[0]), y=float(grasp.direction[1]))
        for grasp in plan.grasps.values()
    ]
    response.carry_paths = [
        _polygon(plan.via_poses_in_table[arm][:, :3, 3]) for arm in plan.grasps
    ]
    response.duration = plan.duration
    return response


def _polygon(points: np.ndarray) -> Polygon:
    return Polygon(
        points=[Point32(x=float(x), y=float(y), z=float(z)) for x, y, z in points.tolist()]
    )
