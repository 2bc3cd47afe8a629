"""How a hand stands at a hem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.config import GraspConfig
from emd_arm_executor.grasp import displacement_keeping_crease, grasp_poses
from emd_arm_executor.hem import Hem
from emd_core.frames import FloatArray


def _hem(x: float, y: float, angle: float) -> Hem:
    return Hem(np.array([x, y]), np.array([np.cos(angle), np.sin(angle)]), 0.0, True, (0, 0))


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -2.0])
def test_first_pose_is_vertical_and_orthogonal_to_the_hem(angle: float) -> None:
    """Fingers down, jaws along the approach direction, gripping inside the hem."""
    config = GraspConfig()
    grasp = next(grasp_poses(_hem(0.1, -0.2, angle), config))
    pose = grasp.transform_tool_to_table
    inward = -np.array([np.cos(angle), np.sin(angle), 0.0])
    assert pose[:3, 2] == pytest.approx([0.0, 0.0, -1.0])
    assert abs(pose[:3, 0] @ inward) == pytest.approx(1.0)
    held = np.array([0.1, -0.2, 0.0]) + config.insertion * inward
    assert pose[:2, 3] == pytest.approx(held[:2])
    assert pose[2, 3] == config.grip_height


def test_all_poses_are_rigid_and_come_from_outside() -> None:
    """Every candidate is a rotation, and drawing it back leads out of the cloth."""
    hem = _hem(0.0, 0.0, 0.7)
    for grasp in grasp_poses(hem):
        rotation = grasp.transform_tool_to_table[:3, :3]
        assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        outside = grasp.at(0.05, 0.0)[:2, 3] - hem.point_in_table
        assert outside @ hem.outward_normal > 0.03


def test_half_turn_grips_the_same() -> None:
    """The two candidates of a posture differ by half a turn about the fingers."""
    poses = [g.transform_tool_to_table for g in grasp_poses(_hem(0.0, 0.1, 2.0))]
    for first, second in zip(poses[::2], poses[1::2], strict=True):
        assert first @ np.diag([-1.0, -1.0, 1.0, 1.0]) == pytest.approx(second)


def test_positive_tilt_points_the_fingers_into_the_cloth() -> None:
    """With a positive tilt the fingers lean along the approach direction."""
    config = replace(GraspConfig(), tilts=(0.3,), yaw_deviations=(0.0,))
    grasp = next(grasp_poses(_hem(0.0, 0.0, 0.0), config))
    fingers = grasp.transform_tool_to_table[:3, 2]
    assert fingers @ [-1.0, 0.0, 0.0] == pytest.approx(np.sin(0.3))
    assert fingers[2] == pytest.approx(-np.cos(0.3))


def _crease(held: FloatArray, displacement: FloatArray) -> float:
    """Where the fold's crease crosses the direction of motion."""
    length = np.linalg.norm(displacement)
    return float(held @ displacement / length + length / 2)


def test_crease_stays_when_the_grip_moves_to_the_hem() -> None:
    """A point inside the cloth is gripped at the hem behind it; the fold line stays."""
    planned, displacement = np.array([[-0.15, 0.05]]), np.array([0.2, 0.0])
    grasp = next(grasp_poses(_hem(-0.2, 0.05, np.pi)))
    corrected = displacement_keeping_crease(displacement, planned, [grasp])
    assert np.linalg.norm(corrected) == pytest.approx(0.2 + 2 * (0.05 - GraspConfig().insertion))
    assert _crease(grasp.held_point_in_table, corrected) == pytest.approx(
        _crease(planned[0], displacement)
    )


def test_shift_across_the_motion_changes_nothing() -> None:
    """Only the shift along the motion moves the crease."""
    hem = _hem(-0.2, 0.05, np.pi)
    config = replace(GraspConfig(), insertion=0.0)
    grasp = next(grasp_poses(hem, config))
    displacement = np.array([0.2, 0.0])
    corrected = displacement_keeping_crease(displacement, np.array([[-0.2, 0.15]]), [grasp])
    assert corrected == pytest.approx(displacement)


def test_two_hands_share_the_mean_shift() -> None:
    """With two hands the mean of their shifts is made up for."""
    config = replace(GraspConfig(), insertion=0.0)
    grasps = [next(grasp_poses(_hem(-0.2, y, np.pi), config)) for y in (-0.1, 0.1)]
    planned = np.array([[-0.17, -0.1], [-0.19, 0.1]])
    corrected = displacement_keeping_crease(np.array([0.3, 0.0]), planned, grasps)
    assert corrected == pytest.approx([0.3 + 2 * 0.02, 0.0])


def test_pulling_outwards_is_left_alone() -> None:
    """A hem that faces along the motion is pulled, not folded: no crease, no correction."""
    grasp = next(grasp_poses(_hem(0.2, 0.0, 0.0)))
    displacement = np.array([0.1, 0.0])
    corrected = displacement_keeping_crease(displacement, np.array([[0.15, 0.0]]), [grasp], 0.01)
    assert corrected == pytest.approx(displacement)


def test_corner_gripped_from_the_side_is_folded() -> None:
    """A side hem whose corner is carried along the hem keeps its crease too."""
    config = replace(GraspConfig(), insertion=0.0)
    grasp = next(grasp_poses(_hem(-0.19, -0.2, -np.pi / 2), config))
    planned, displacement = np.array([[-0.2, -0.2]]), np.array([0.4, 0.0])
    corrected = displacement_keeping_crease(displacement, planned, [grasp])
    assert corrected == pytest.approx([0.38, 0.0])


def test_depth_of_the_jaws_shortens_a_fold() -> None:
    """What the jaws hold flat is taken off the length, twice."""
    config = replace(GraspConfig(), insertion=0.0)
    grasp = next(grasp_poses(_hem(-0.2, 0.0, np.pi), config))
    corrected = displacement_keeping_crease(
        np.array([0.3, 0.0]), np.array([[-0.2, 0.0]]), [grasp], 0.006
    )
    assert corrected == pytest.approx([0.288, 0.0])
