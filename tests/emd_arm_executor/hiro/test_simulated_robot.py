"""The simulated cell behind the executor's robot interface."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.description import JOINT_GROUPS, OBSERVE
from emd_arm_executor.hiro.simulated_robot import SimulatedRobot
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_core.errors import InvalidInputError


@pytest.fixture
def robot(world, cloth) -> SimulatedRobot:
    """A robot in the observe posture beside a flat cloth."""
    return SimulatedRobot(CellSimulation(world, cloth))


def quintic(group: str, start: np.ndarray, end: np.ndarray, duration: float) -> JointTrajectory:
    """From rest to rest in two points."""
    positions = np.stack([start, end])
    zero = np.zeros_like(positions)
    times = np.array([0.0, duration])
    return JointTrajectory(JOINT_GROUPS[group].joints, times, positions, zero, zero)


@pytest.mark.parametrize("time", [0.1, 0.12345, 0.5 + 1e-12])
def test_waiting_reaches_the_time(robot: SimulatedRobot, time: float) -> None:
    """After `wait_until(t)` the clock shows t or up to one time step more."""
    robot.wait_until(time)
    assert time <= robot.now() <= time + 1 / 240 + 1e-9
    before = robot.now()
    robot.wait_until(time - 0.05)
    assert robot.now() == before


def test_trajectory_waits_for_its_start_time(robot: SimulatedRobot) -> None:
    """A trajectory sent ahead of time begins when it should and ends at its last point."""
    start = OBSERVE.positions("left_arm")
    end = start + np.array([0.2, 0, 0, 0, 0, 0])
    robot.send_trajectory("left_arm", quintic("left_arm", start, end, 0.5), start_time=0.3)
    robot.wait_until(0.29)
    assert robot.joint_positions()["LARM_JOINT0"] == pytest.approx(start[0], abs=1e-3)
    robot.wait_until(0.55)
    assert robot.joint_positions()["LARM_JOINT0"] == pytest.approx(start[0] + 0.1, abs=5e-3)
    robot.wait_until(1.0)
    assert robot.joint_positions()["LARM_JOINT0"] == pytest.approx(end[0], abs=1e-3)


def test_jaws_open_and_close(robot: SimulatedRobot) -> None:
    """Jaws reach the width that was sent, each hand for itself."""
    robot.send_gripper("right", 0.06)
    robot.wait_until(1.0)
    assert robot.gripper_width("right") == pytest.approx(0.06, abs=2e-4)
    assert robot.gripper_width("left") == pytest.approx(0.032, abs=2e-4)


def test_hold_stops_everything(robot: SimulatedRobot) -> None:
    """After `hold` the arms stay where they had got to."""
    start = OBSERVE.positions("left_arm")
    end = start - np.array([0.4, 0, 0, 0, 0, 0])
    robot.send_trajectory("left_arm", quintic("left_arm", start, end, 1.0), start_time=0.0)
    robot.wait_until(0.5)
    robot.hold()
    robot.wait_until(0.7)
    stopped = robot.joint_positions()["LARM_JOINT0"]
    robot.wait_until(1.5)
    assert robot.joint_positions()["LARM_JOINT0"] == pytest.approx(stopped, abs=2e-3)
    assert start[0] - 0.3 < stopped < start[0] - 0.1


def test_steps_are_reported(world, cloth) -> None:
    """`on_step` is called about every 1/60 s of simulated time."""
    calls: list[float] = []
    simulation = CellSimulation(world, cloth)
    robot = SimulatedRobot(simulation, on_step=lambda: calls.append(simulation.time))
    robot.wait_until(0.5)
    assert len(calls) == pytest.approx(30, abs=1)


def test_unknown_arm_is_refused(robot: SimulatedRobot) -> None:
    """There is no third arm."""
    with pytest.raises(InvalidInputError, match="middle"):
        robot.send_gripper("middle", 0.01)
