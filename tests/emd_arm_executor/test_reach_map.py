"""The reach map of HIRO's cell, sampled very coarsely."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emd_arm_executor.config import MotionConfig, ReachConfig
from emd_arm_executor.reach_map import cached_reach_map, identity
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_core.reach_map import ReachMap

COARSE = MotionConfig(reach=ReachConfig(extent=0.30, map_step=0.15, directions=2))


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """HIRO whose map has five samples along each side and two directions."""
    return RobotModel(hiro_description(), COARSE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where maps are kept."""
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(scope="module")
def reach(robot: RobotModel, folder: Path) -> ReachMap:
    """The map, computed."""
    return cached_reach_map(robot, folder)


def test_each_arm_reaches_its_own_side(reach: ReachMap) -> None:
    """The left arm reaches more at y < 0, the right arm at y > 0, none the far corners."""
    left, right = reach.grasp.sum(axis=1)
    assert left[:, :2].sum() > left[:, 3:].sum()
    assert right[:, 3:].sum() > right[:, :2].sum()
    assert not reach.grasp[:, :, 0, [0, -1]].any()


def test_the_middle_can_be_released_on_by_both(reach: ReachMap) -> None:
    """Both arms let go over the middle of the table with some direction of the hand."""
    assert reach.release[:, :, 2, 2].any(axis=1).all()


def test_a_kept_map_is_read_again(robot: RobotModel, reach: ReachMap, folder: Path) -> None:
    """The second time nothing is computed."""
    calls: list[int] = []
    again = cached_reach_map(robot, folder, lambda done, total: calls.append(done))
    assert not calls
    assert np.array_equal(again.grasp, reach.grasp)


def test_another_table_is_another_map(robot: RobotModel) -> None:
    """A moved table, other limits or other figures of the motion change the identity."""
    description = hiro_description()
    moved = description.transform_table_to_base.copy()
    moved[0, 3] += 0.01
    other = RobotModel(replace(description, transform_table_to_base=moved), COARSE)
    finer = RobotModel(description, MotionConfig())
    assert len({identity(robot), identity(other), identity(finer)}) == 3
    assert identity(robot) == identity(RobotModel(hiro_description(), COARSE))
