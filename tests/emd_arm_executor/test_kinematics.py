"""Forward and inverse kinematics of HIRO's arms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from emd_arm_executor.arm_group import ArmGroup, configuration
from emd_arm_executor.kinematics import ArmKinematics
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import InvalidInputError, OutOfReachError
from emd_core.frames import FloatArray


def test_forward_agrees_with_the_published_initial_pose(robot: RobotModel) -> None:
    """HIRO's own client prints where LARM_JOINT5 is at goInitial; the hand is 0.127 m below."""
    arm = robot.arms["left"]
    initial = np.deg2rad([0.6, 0.0, -100.0, -15.2, 9.4, -3.2])
    tool = arm.forward(initial)
    wrist = tool[:3, 3] - 0.126625 * tool[:3, 2]
    assert wrist == pytest.approx([0.325563, 0.182364, 0.074624], abs=2e-6)
    assert tool[:3, 2] == pytest.approx([0.0, 0.0, -1.0], abs=3e-3)


def test_arms_mirror_each_other(robot: RobotModel, reachable_postures: FloatArray) -> None:
    """The right arm at mirrored joints holds its hand at the mirrored place."""
    mirror = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
    for posture in reachable_postures[:20]:
        left = robot.arms["left"].forward(posture)[:3, 3]
        right = robot.arms["right"].forward(mirror * posture)[:3, 3]
        assert right == pytest.approx(left * [1.0, -1.0, 1.0], abs=1e-9)


def test_jacobian_agrees_with_finite_differences(
    robot: RobotModel, reachable_postures: FloatArray
) -> None:
    """Columns of the Jacobian are the tool's velocities under single joints, in its own frame."""
    arm, step = robot.arms["left"], 1e-6
    for posture in reachable_postures[:20]:
        jacobian = arm.jacobian(posture)
        pose = pin.SE3(arm.forward(posture))
        for joint in range(6):
            moved = posture.copy()
            moved[joint] += step
            velocity = pin.log6(pose.actInv(pin.SE3(arm.forward(moved)))).vector / step
            assert jacobian[:, joint] == pytest.approx(velocity, abs=1e-5)


@pytest.mark.parametrize("name", ["left", "right"])
def test_every_reachable_pose_is_solved(robot: RobotModel, name: str) -> None:
    """Poses made from random postures inside the limits all have a solution inside the limits."""
    arm = robot.arms[name]
    postures = np.random.default_rng(11).uniform(arm.lower, arm.upper, (300, 6))
    middle = (arm.lower + arm.upper) / 2
    for posture in postures:
        target = arm.forward(posture)
        found = arm.solve(target, middle)
        assert (found >= arm.lower).all() and (found <= arm.upper).all()
        gap = pin.log6(pin.SE3(target).actInv(pin.SE3(arm.forward(found)))).vector
        assert np.linalg.norm(gap[:3]) < 1e-5
        assert np.linalg.norm(gap[3:]) < 1e-5


def test_solutions_are_distinct_and_all_fit(
    robot: RobotModel, reachable_postures: FloatArray
) -> None:
    """Several postures for one pose differ, and each takes the pose."""
    arm = robot.arms["left"]
    several = 0
    for posture in reachable_postures[:30]:
        target = arm.forward(posture)
        found = list(arm.solutions(target, (posture,)))
        assert np.abs(found[0] - posture).max() < 1e-4
        several += len(found) > 1
        for i, one in enumerate(found):
            assert arm.forward(one) == pytest.approx(target, abs=1e-5)
            assert all(np.abs(one - other).max() >= 0.05 for other in found[:i])
    assert several > 0


def test_same_question_same_answer(robot: RobotModel, reachable_postures: FloatArray) -> None:
    """Restarts are seeded: two arms built alike answer bit by bit alike."""
    description = robot.description
    model = pin.buildModelFromUrdf(str(description.urdf))
    locked = configuration(model, dict(description.rest))
    again = ArmKinematics(model, description.arms["left"].group, locked)
    seed = np.zeros(6)
    for posture in reachable_postures[:10]:
        target = robot.arms["left"].forward(posture)
        assert np.array_equal(robot.arms["left"].solve(target, seed), again.solve(target, seed))


def test_unreachable_pose_says_how_near_the_arm_comes(robot: RobotModel) -> None:
    """A pose 1 m ahead is refused with the arm, the place and the gap that is left."""
    arm = robot.arms["right"]
    target = np.diag([1.0, -1.0, -1.0, 1.0])
    target[:3, 3] = [1.2, -0.2, 0.0]
    with pytest.raises(OutOfReachError, match=r"right arm.*\(1\.200, -0\.200, 0\.000\)") as caught:
        arm.solve(target, np.zeros(6))
    gap = float(str(caught.value).split("within ")[1].split(" mm")[0])
    assert 300 < gap < 900


def test_straight_line_is_followed_exactly(robot: RobotModel) -> None:
    """On a dense line the arm stays on its branch and on the line."""
    arm = robot.arms["left"]
    start = np.deg2rad([0.6, 0.0, -100.0, -15.2, 9.4, -3.2])
    poses = np.repeat(arm.forward(start)[None], 40, axis=0)
    poses[:, 1, 3] += np.linspace(0.0, 0.15, 40)
    path = follow_poses(arm, poses, start)
    assert np.abs(np.diff(path, axis=0)).max() < 0.05
    for pose, posture in zip(poses, path, strict=True):
        assert arm.forward(posture) == pytest.approx(pose, abs=1e-5)


def test_path_out_of_the_workspace_names_the_pose(robot: RobotModel) -> None:
    """A line that leaves the workspace is refused where it leaves."""
    arm = robot.arms["left"]
    start = np.deg2rad([0.6, 0.0, -100.0, -15.2, 9.4, -3.2])
    poses = np.repeat(arm.forward(start)[None], 100, axis=0)
    poses[:, 0, 3] += np.linspace(0.0, 0.5, 100)
    with pytest.raises(OutOfReachError, match=r"pose \d+ of 100"):
        follow_poses(arm, poses, start)


def test_jump_between_poses_is_refused(robot: RobotModel) -> None:
    """Poses so far apart that a joint would jump are not a path."""
    arm = robot.arms["left"]
    start = np.deg2rad([0.6, 0.0, -100.0, -15.2, 9.4, -3.2])
    poses = np.repeat(arm.forward(start)[None], 2, axis=0)
    poses[1, 1, 3] += 0.1
    with pytest.raises(OutOfReachError, match="jump"):
        follow_poses(arm, poses, start, max_step=0.05)


@pytest.mark.parametrize(
    ("joints", "frame"),
    [
        (("LARM_JOINT0", "ELBOW"), "left_tool"),
        (("LARM_JOINT0",), "left_spoon"),
        (("LARM_JOINT1", "LARM_JOINT0"), "left_tool"),
    ],
)
def test_wrong_groups_are_refused(robot: RobotModel, joints: tuple[str, ...], frame: str) -> None:
    """Unknown joints and frames, and joints out of order, are refused."""
    model = pin.buildModelFromUrdf(str(robot.description.urdf))
    with pytest.raises(InvalidInputError):
        ArmKinematics(model, ArmGroup("left", joints, frame), pin.neutral(model))


def test_unknown_joint_in_a_posture_is_refused(robot: RobotModel) -> None:
    """A posture that names a joint the robot does not have is refused."""
    model = pin.buildModelFromUrdf(str(robot.description.urdf))
    with pytest.raises(InvalidInputError, match="TAIL"):
        configuration(model, {"TAIL": 0.1})
