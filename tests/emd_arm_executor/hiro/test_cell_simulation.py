"""Robot and cloth in lockstep."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.cell_simulation import CellSimulation, CellSimulationConfig
from emd_arm_executor.hiro.description import JOINT_GROUPS, JOINT_NAMES, OBSERVE, Posture
from emd_arm_executor.hiro.gripper import GripperGeometry
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.errors import InvalidInputError

GRIPPER = GripperGeometry()
# The left hand over the table at about y = -0.17 m of the table frame, 2 cm above it.
OVER_CLOTH = np.radians([0.6, -5.0, -103.0, -15.2, 14.0, -3.2])


def posture_over_cloth() -> Posture:
    """The observe posture but for the left arm, whose hand is above the cloth, jaws 32 mm open."""
    return Posture("over cloth", dict(OBSERVE.groups) | {"left_arm": tuple(OVER_CLOTH)})


def move(group: str, positions, duration: float = 0.6) -> CommandedTrajectory:
    """A smooth motion of one group to rest."""
    joints = JOINT_GROUPS[group].joints
    return CommandedTrajectory(joints, [duration], [positions], np.zeros((1, len(joints))))


def test_robot_follows_a_trajectory_closely(world, cloth) -> None:
    """Along a smooth motion the measured joints stay within 1 mrad of the wanted ones."""
    simulation = CellSimulation(world, cloth)
    simulation.follow("left_arm", move("left_arm", OVER_CLOTH, 1.5))
    worst = 0.0
    while simulation.is_moving("left_arm"):
        simulation.step(1 / 60)
        worst = max(worst, np.abs(simulation.desired()[0] - world.joint_positions).max())
    assert worst < 1e-3
    assert world.group_positions("left_arm") == pytest.approx(OVER_CLOTH, abs=1e-3)
    still = OBSERVE.positions("right_arm")
    assert world.group_positions("right_arm") == pytest.approx(still, abs=2e-4)


def test_closing_hand_grasps_and_opening_hand_releases(cloth) -> None:
    """The cloth hears of one grasp when the jaws close and of one release when they open."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
        assert cloth.log == [("grasp", 0)]
        assert simulation.held_vertices == (1, 0)
        assert cloth.hand_poses[0] == pytest.approx(world.tool_transform_in_table(0), abs=1e-3)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.05)))
        simulation.step(1.0)
        assert cloth.log == [("grasp", 0), ("release", 0)]
        assert simulation.held_vertices == (0, 0)


def test_jaws_stop_at_the_cloth_they_hold(cloth) -> None:
    """Jaws told to close fully stay a cloth's thickness apart when they hold it."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
        assert world.gripper_width(0) == pytest.approx(cloth.thickness, abs=2e-4)


def test_fingers_enclose_what_they_closed_around(cloth) -> None:
    """The cloth is told the space between the jaws when they close, and how deep they were."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
    jaws, limit = cloth.jaws[0], simulation.config.grasp_width
    assert 0.9 * limit < jaws.upper[0] - jaws.lower[0] < limit
    assert jaws.upper[2] == pytest.approx(GRIPPER.tip_advance(2 * GRIPPER.half_gap), abs=1e-4)


def test_jaws_close_when_cloth_slips_out(cloth) -> None:
    """Jaws from which the cloth has been pulled close fully, so that the loss is measured."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
        cloth.held[0] = 0
        simulation.step(0.2)
        assert simulation.held_vertices == (0, 0)
        assert world.gripper_width(0) == pytest.approx(0.0, abs=2e-4)


def test_jaws_close_fully_on_nothing(world, cloth) -> None:
    """A hand that closes beside the cloth holds nothing, closes to 0, and needs no release."""
    simulation = CellSimulation(world, cloth)
    for width in (0.0, 0.05):
        target = move("right_gripper", GRIPPER.joints_from_width(width))
        simulation.follow("right_gripper", target)
        simulation.step(1.0)
        assert simulation.held_vertices == (0, 0)
        assert world.gripper_width(1) == pytest.approx(width, abs=2e-4)
    assert cloth.log == [("grasp", 1)]


def test_held_cloth_moves_with_the_hand(cloth) -> None:
    """While a hand holds cloth it is told the hand's pose before every step."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
        lifted = OVER_CLOTH + np.radians([0, -10, -8, 0, 0, 0])
        simulation.follow("left_arm", move("left_arm", lifted, 1.0))
        low = cloth.hand_poses[0][2, 3]
        simulation.step(1.2)
        assert cloth.hand_poses[0][2, 3] > low + 0.03
        assert cloth.hand_poses[0] == pytest.approx(world.tool_transform_in_table(0))


def test_cloth_and_robot_keep_the_same_time(world, cloth) -> None:
    """A moving cloth is advanced by exactly the simulated time, also in uneven steps."""
    cloth.at_rest = False
    simulation = CellSimulation(world, cloth)
    made = sum(simulation.step(duration) for duration in (0.1, 0.033, 0.0, 0.0167, 0.05))
    assert made == int(0.1997 * 240 + 1e-6)
    assert simulation.time == pytest.approx(made / 240)
    assert cloth.time == pytest.approx(simulation.time)


def test_cloth_at_rest_costs_nothing(world, cloth) -> None:
    """A settled cloth that no hand holds is not advanced."""
    CellSimulation(world, cloth).step(0.2)
    assert cloth.time == 0.0


def test_hold_stops_a_motion(world, cloth) -> None:
    """After `hold` a group stays where its trajectory had got to."""
    simulation = CellSimulation(world, cloth)
    simulation.follow("head", move("head", [0.5, 0.2], 2.0))
    simulation.step(1.0)
    simulation.hold("head")
    simulation.step(0.1)
    stopped = world.group_positions("head")
    simulation.step(0.5)
    assert not simulation.is_moving("head")
    assert world.group_positions("head") == pytest.approx(stopped, abs=2e-3)
    assert 0.1 < stopped[0] < 0.4


def test_reset_lets_go_and_takes_the_posture(cloth) -> None:
    """`reset` releases the cloth and holds the new posture."""
    with HiroWorld(posture=posture_over_cloth()) as world:
        simulation = CellSimulation(world, cloth)
        simulation.follow("left_gripper", move("left_gripper", GRIPPER.joints_from_width(0.0)))
        simulation.step(1.0)
        simulation.reset(OBSERVE)
        simulation.step(0.1)
        assert cloth.log == [("grasp", 0), ("release", 0)]
        wanted = np.array([OBSERVE.by_joint()[name] for name in JOINT_NAMES])
        assert world.joint_positions == pytest.approx(wanted, abs=2e-4)


def test_foreign_group_and_bad_duration_are_refused(world, cloth) -> None:
    """A group that does not exist, joints of another group and negative time raise."""
    simulation = CellSimulation(world, cloth)
    with pytest.raises(InvalidInputError, match="tail"):
        simulation.follow("tail", move("head", [0.0, 0.0]))
    with pytest.raises(InvalidInputError, match="is wanted"):
        simulation.follow("torso", move("head", [0.0, 0.0]))
    with pytest.raises(InvalidInputError, match="duration"):
        simulation.step(-0.1)
    with pytest.raises(InvalidInputError, match="grasp_width"):
        CellSimulationConfig(grasp_width=0.02)
