"""Plans carried out by the simulated HIRO, whose solids really collide."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.simulated_cloth import Jaws

pytest.importorskip("pybullet")

from emd_arm_executor.hiro.cell_simulation import CellSimulation  # noqa: E402
from emd_arm_executor.hiro.simulated_robot import SimulatedRobot  # noqa: E402
from emd_arm_executor.hiro.world import HiroWorld  # noqa: E402


class _Sheet:
    """Cloth that notes where it is grasped and released, and is always at rest."""

    thickness = 0.003
    settled = True
    positions_in_table: FloatArray = np.zeros((3, 3))
    triangles: NDArray[np.int32] = np.zeros((0, 3), dtype=np.int32)

    def __init__(self) -> None:
        self.grasped: dict[int, FloatArray] = {}
        self.last: dict[int, FloatArray] = {}
        self.released: list[int] = []

    def grasp(self, hand: int, transform_tool_to_table: FloatArray, jaws: Jaws) -> int:
        self.grasped[hand] = transform_tool_to_table.copy()
        return 9

    def held_count(self, hand: int) -> int:
        return 9 if hand in self.grasped and hand not in self.released else 0

    def move_hand(self, hand: int, transform_tool_to_table: FloatArray) -> None:
        self.last[hand] = transform_tool_to_table.copy()

    def release(self, hand: int) -> None:
        if self.held_count(hand):
            self.released.append(hand)

    def advance(self, duration: float) -> None:
        return None


FOLDS = [
    ([[-0.2, -0.2], [-0.2, 0.2]], [0.4, 0.0]),
    pytest.param([[0.2, -0.2], [0.2, 0.2]], [-0.4, 0.0], marks=pytest.mark.slow),
    pytest.param([[-0.2, -0.2]], [0.4, 0.4], marks=pytest.mark.slow),
    pytest.param([[0.2, 0.2]], [-0.2, -0.2], marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("points", "displacement"), FOLDS)
def test_neat_folds_run_without_a_touch(
    robot: RobotModel,
    planner: MotionPlanner,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
    points: list[list[float]],
    displacement: list[float],
) -> None:
    """The servos follow within 1 degree, nails touch nothing but the table, cloth is carried."""
    sheet, touched = _Sheet(), set()
    with HiroWorld() as world:

        def look() -> None:
            contacts = world.contacts()
            touched.update(c.link_b for c in contacts if "nail" in c.link_a)
            touched.update(c.link_a for c in contacts if "nail" not in c.link_a)

        simulated = SimulatedRobot(CellSimulation(world, sheet), on_step=look)
        plan = planner.plan_motion(
            task(points, displacement), towel(), simulated.joint_positions()
        )
        MotionExecutor(simulated, robot).run(plan)
    assert touched <= {"table"}
    assert sorted(sheet.released) == sorted(sheet.grasped)
    assert len(sheet.grasped) == len(points)
    for hand, start in sheet.grasped.items():
        moved = sheet.last[hand][:2, 3] - start[:2, 3]
        wanted = plan.displacements_in_table[("left", "right")[hand]]
        assert moved == pytest.approx(wanted, abs=0.003)
