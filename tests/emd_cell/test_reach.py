"""The planner's reach limit is the executor's reach."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from emd_arm_executor.reach_region import reach_region
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_planner.config import ReachConfig


@pytest.mark.parametrize("arm", ["left", "right"])
def test_the_planner_knows_where_the_arms_reach(arm) -> None:
    """Its default polygon covers the same ground as the one computed by inverse kinematics."""
    stated = np.array(getattr(ReachConfig(), arm))
    computed = reach_region(RobotModel(hiro_description()), arm)
    areas = [ConvexHull(corners).volume for corners in (stated, computed)]
    both = ConvexHull(np.vstack([stated, computed])).volume
    assert both < 1.03 * min(areas)
