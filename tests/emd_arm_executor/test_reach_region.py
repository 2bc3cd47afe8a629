"""The arms' reach on the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.config import MotionConfig, ReachConfig
from emd_arm_executor.reach_region import reach_region
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import OutOfReachError
from emd_core.frames import FloatArray


@pytest.fixture(scope="module")
def coarse() -> RobotModel:
    """HIRO, its reach sampled coarsely."""
    return RobotModel(hiro_description(), MotionConfig(reach=ReachConfig(step=0.06)))


@pytest.fixture(scope="module")
def regions(coarse: RobotModel) -> dict[str, FloatArray]:
    """The polygons of both arms."""
    return {arm: reach_region(coarse, arm) for arm in ("left", "right")}


def _inside(polygon: FloatArray, point: FloatArray, slack: float = 0.0) -> bool:
    ahead = np.roll(polygon, -1, axis=0) - polygon
    offset = point - polygon
    cross = ahead[:, 0] * offset[:, 1] - ahead[:, 1] * offset[:, 0]
    return bool((cross >= -slack * np.linalg.norm(ahead, axis=1)).all())


@pytest.mark.parametrize("arm", ["left", "right"])
def test_region_is_convex_and_counter_clockwise(regions: dict[str, FloatArray], arm: str) -> None:
    """Every turn of the outline is to the left."""
    ahead = np.roll(regions[arm], -1, axis=0) - regions[arm]
    after = np.roll(ahead, -1, axis=0)
    assert (ahead[:, 0] * after[:, 1] - ahead[:, 1] * after[:, 0] > 0).all()


def test_each_arm_reaches_its_own_side(regions: dict[str, FloatArray]) -> None:
    """The left arm reaches farther to y < 0, the right arm to y > 0, both the middle."""
    for arm, side in (("left", -1.0), ("right", 1.0)):
        assert _inside(regions[arm], np.array([0.0, 0.0]))
        assert _inside(regions[arm], np.array([-0.05, 0.2 * side]))
        assert not _inside(regions[arm], np.array([-0.24, -0.2 * side]))


def test_points_inside_can_be_gripped(coarse: RobotModel, regions: dict[str, FloatArray]) -> None:
    """A vertical hand takes any point of the region's inner part at the grip height."""
    polygon = regions["left"]
    rng = np.random.default_rng(5)
    arm, rest = coarse.arms["left"], coarse.rest_positions(["left"])
    for weights in rng.dirichlet(np.ones(len(polygon)), 15):
        vertical = np.diag([1.0, -1.0, -1.0, 1.0])
        vertical[:3, 3] = [*(weights @ polygon), coarse.config.grasp.grip_height]
        target = coarse.transform_table_to_base @ vertical
        assert arm.forward(arm.solve(target, rest)) == pytest.approx(target, abs=1e-4)


def test_table_out_of_reach_has_no_region() -> None:
    """A sampled area that no arm reaches is refused."""
    description = hiro_description()
    away = description.transform_table_to_base.copy()
    away[0, 3] += 2.0
    far = RobotModel(
        replace(description, transform_table_to_base=away),
        MotionConfig(reach=ReachConfig(step=0.2)),
    )
    with pytest.raises(OutOfReachError):
        reach_region(far, "left")
