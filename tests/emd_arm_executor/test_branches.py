"""Inverse kinematics against an exact search for every branch of HIRO's left arm."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.optimize import brentq

from emd_arm_executor.hiro.figures.joints import LEFT_ARM
from emd_arm_executor.kinematics import ArmKinematics
from emd_arm_executor.robot_model import RobotModel
from emd_core.frames import FloatArray

SHOULDER, _, ELBOW, FOREARM, WRIST, HAND = (np.array(joint.origin) for joint in LEFT_ARM)
SIDE, UPPER = ELBOW[1], -ELBOW[2]
LOWER, BEND = np.hypot(FOREARM[0], WRIST[2]), np.arctan2(-FOREARM[0], -WRIST[2])


def rot(axis: str, angle: float) -> FloatArray:
    """Rotate about one axis."""
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def first_joints(
    last: float, hand: FloatArray, signs: tuple[int, int]
) -> tuple[FloatArray, FloatArray] | None:
    """Joints 0, 1, 2 and the rotation left for joints 3 and 4, if the last joint stands so.

    Joints 3 and 4 meet in a point that the last joint moves on a circle. Joints 1 and 2 are
    parallel and joint 0 crosses joint 1, so the point determines all three up to two signs.
    """
    rolled = rot("x", np.deg2rad(LEFT_ARM[0].roll))
    wrist = rolled.T @ hand[:3, :3] @ rot("x", -last)
    point = rolled.T @ (hand[:3, 3] - SHOULDER) - wrist @ HAND
    level = np.hypot(point[0], point[1])
    if level < SIDE:
        return None
    q0 = signs[0] * np.arccos(SIDE / level) - np.arctan2(point[0], point[1])
    x, _, z = rot("z", -q0) @ point
    cosine = (x * x + z * z - UPPER**2 - LOWER**2) / (2.0 * UPPER * LOWER)
    if abs(cosine) > 1.0:
        return None
    q2 = signs[1] * np.arccos(cosine) - BEND
    arm = np.array([0.0, 0.0, -UPPER]) + rot("y", q2) @ (FOREARM + WRIST)
    q1 = np.arctan2(x, z) - np.arctan2(arm[0], arm[2])
    return np.array([q0, q1, q2]), rot("y", -q1 - q2) @ rot("z", -q0) @ wrist


def exact_branches(arm: ArmKinematics, target: FloatArray, count: int = 1500) -> list[FloatArray]:
    """Scan the last joint for the places where joints 3 and 4 can take the rotation left."""

    def gap(last: float, signs: tuple[int, int]) -> float:
        found = first_joints(last, hand, signs)
        return np.nan if found is None else float(found[1][2, 1])

    fixed = np.eye(4)
    fixed[:3, :3], fixed[:3, 3] = arm.chain.links[-1][:, :3], arm.chain.links[-1][:, 3]
    hand = target @ np.linalg.inv(fixed)
    grid = np.linspace(arm.lower[5], arm.upper[5], count)
    found: list[FloatArray] = []
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        values = np.array([gap(last, signs) for last in grid])
        for k in np.nonzero(values[:-1] * values[1:] < 0.0)[0]:
            last = brentq(gap, grid[k], grid[k + 1], args=(signs,), xtol=1e-13)
            first, left = first_joints(last, hand, signs) or (None, None)
            assert first is not None and left is not None
            q3, q4 = np.arctan2(-left[0, 1], left[1, 1]), np.arctan2(-left[2, 0], left[2, 2])
            found.extend(within(arm, np.array([*first, q3, q4, last])))
    return found


def within(arm: ArmKinematics, joints: FloatArray) -> Iterator[FloatArray]:
    """Give the joints, wrapped into one turn, if they keep the limits."""
    wrapped = np.angle(np.exp(1j * joints))
    if (wrapped >= arm.lower - 1e-9).all() and (wrapped <= arm.upper + 1e-9).all():
        yield wrapped


@pytest.fixture(scope="module")
def targets(robot: RobotModel) -> FloatArray:
    """Poses of the left hand at random postures, shape (40, 4, 4)."""
    arm = robot.arms["left"]
    return arm.chain.forward(np.random.default_rng(3).uniform(arm.lower, arm.upper, (40, 6)))


@pytest.mark.slow
def test_every_branch_of_the_exact_search_is_found(robot: RobotModel, targets: FloatArray) -> None:
    """Of all branches that an independent search finds, the restarts find 98 in 100 and more.

    What they miss are pairs of branches about to merge at a singularity, or at a limit.
    """
    arm = robot.arms["left"]
    known = missed = 0
    for target in targets:
        found = list(arm.solutions(target))
        for branch in exact_branches(arm, target):
            assert arm.forward(branch) == pytest.approx(target, abs=1e-8)
            known += 1
            missed += all(np.abs(branch - other).max() > 0.05 for other in found)
    assert known > len(targets)
    assert missed <= 0.02 * known


def test_nearest_pose_is_nearer_than_any_of_many_postures(robot: RobotModel) -> None:
    """Beyond its reach the arm stops nearer to the target than at 4000 random postures."""
    arm = robot.arms["left"]
    target = np.diag([1.0, -1.0, -1.0, 1.0])
    target[:3, 3] = [0.75, 0.25, 0.0]
    nearest = arm.nearest(target)
    assert not nearest.solved
    reached = arm.forward(nearest.positions)
    assert np.linalg.norm(reached[:3, 3] - target[:3, 3]) == pytest.approx(nearest.distance)
    rng = np.random.default_rng(5)
    poses = arm.chain.forward(rng.uniform(arm.lower, arm.upper, (4000, 6)))
    gaps = np.linalg.norm(poses[:, :3, 3] - target[:3, 3], axis=1)
    angles = np.arccos(
        np.clip((np.einsum("nij,ij->n", poses[:, :3, :3], target[:3, :3]) - 1) / 2, -1, 1)
    )
    assert nearest.cost < (gaps + 0.2 * angles).min()


def test_safe_limits_of_the_forearm_are_kept(robot: RobotModel) -> None:
    """Sources disagree on ARM_JOINT3; planning keeps what all of them allow."""
    for name in ("left", "right"):
        arm = robot.arms[name]
        assert np.rad2deg([arm.lower[3], arm.upper[3]]) == pytest.approx([-105.0, 105.0])
