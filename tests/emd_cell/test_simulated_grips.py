"""The simulated HIRO grasps simulated cloth: it holds, it misses, and the camera tells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pybullet")

from emd_arm_executor.executor import MotionExecutor  # noqa: E402
from emd_arm_executor.hiro.cell_simulation import CellSimulation  # noqa: E402
from emd_arm_executor.hiro.simulated_robot import SimulatedRobot  # noqa: E402
from emd_arm_executor.hiro.world import HiroWorld  # noqa: E402
from emd_arm_executor.manipulation_runner import ManipulationRunner  # noqa: E402
from emd_arm_executor.motion_planner import MotionPlanner  # noqa: E402
from emd_arm_executor.observed_silhouette import silhouette_from_points  # noqa: E402
from emd_arm_executor.robot_description import hiro_description  # noqa: E402
from emd_arm_executor.robot_model import RobotModel  # noqa: E402
from emd_arm_executor.silhouette import Silhouette  # noqa: E402
from emd_cloth_sim.cloth import Cloth  # noqa: E402
from emd_cloth_sim.config import ClothConfig  # noqa: E402
from emd_core.errors import GraspFailedError  # noqa: E402
from emd_core.manipulation import Manipulation  # noqa: E402

CORNER = Manipulation(np.array([[0.18, -0.18], [np.nan, np.nan]]), np.array([-0.12, 0.12]))
# Nails that close here stay 10 mm above a flat cloth.
TOO_HIGH = 0.018


class DeceivedRobot(SimulatedRobot):
    """Its jaws seem to hold something always, as if they could not close for dirt."""

    def gripper_width(self, arm: str) -> float:
        """Give at least the thickness of cloth, metres."""
        return max(super().gripper_width(arm), 0.003)


class Scene:
    """A flat cloth before the robot, and someone who sees where the cloth is."""

    def __init__(self, world: HiroWorld) -> None:
        """Lay a coarse cloth of the cell's size."""
        self.cloth = Cloth(ClothConfig(vertices=(21, 21)))
        self.simulation = CellSimulation(world, self.cloth)
        self.looks = 0

    def look(self) -> Silhouette:
        """See the cloth's vertices and what lies between them, as points 5 mm apart."""
        self.looks += 1
        corners = self.cloth.positions_in_table[self.cloth.triangles]
        shares = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4.0
        return silhouette_from_points((shares @ corners).reshape(-1, 3))

    def runner(
        self, robot: SimulatedRobot, grip_height: float | None = None
    ) -> ManipulationRunner:
        """Carry manipulations out, closing the jaws at a height, metres."""
        model = RobotModel(hiro_description())
        if grip_height is not None:
            grasp = replace(model.config.grasp, grip_height=grip_height)
            model = RobotModel(hiro_description(), replace(model.config, grasp=grasp))
        return ManipulationRunner(MotionPlanner(model), MotionExecutor(robot, model), self.look)


@pytest.fixture
def scene() -> Iterator[Scene]:
    """A scene of one's own."""
    with HiroWorld() as world:
        yield Scene(world)


def test_a_folded_corner_is_seen(scene: Scene) -> None:
    """The corner comes along with the fingers, at the first grasp, and one look confirms it."""
    runner = scene.runner(SimulatedRobot(scene.simulation))
    before = scene.cloth.positions_in_table
    runner.run(CORNER, scene.look())
    moved = np.linalg.norm(scene.cloth.positions_in_table - before, axis=1)
    assert moved[np.argmax(before @ [1.0, -1.0, 0.0])] > 0.1
    assert scene.looks == 2


def test_fingers_that_close_above_the_cloth_miss_it(scene: Scene) -> None:
    """Both tries close on nothing, and nothing is pulled along from afar."""
    runner = scene.runner(SimulatedRobot(scene.simulation), TOO_HIGH)
    before = scene.cloth.positions_in_table
    with pytest.raises(GraspFailedError, match="closed on nothing.*second try"):
        runner.run(CORNER, scene.look())
    assert np.abs(scene.cloth.positions_in_table - before).max() < 1e-4


def test_jaws_that_seem_to_hold_something_are_not_believed(scene: Scene) -> None:
    """What the jaws cannot tell the camera does: the cloth lies as before."""
    runner = scene.runner(DeceivedRobot(scene.simulation), TOO_HIGH)
    with pytest.raises(GraspFailedError, match="camera sees its hem.*second try"):
        runner.run(CORNER, scene.look())
    assert scene.simulation.held_vertices == (0, 0)
