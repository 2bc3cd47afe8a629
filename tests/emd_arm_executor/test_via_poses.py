"""The hands' paths in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from emd_arm_executor.config import PathConfig
from emd_arm_executor.via_poses import OrientedPoint, carry_poses, line_poses
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

CONFIG = PathConfig()


def _carry(span: float, shape: str = "arc", yaw: float = 0.0, end: float = 0.004) -> FloatArray:
    start = OrientedPoint(np.array([-0.1, 0.05, 0.004]))
    release = OrientedPoint(np.array([-0.1 + span, 0.05, end]), yaw)
    return carry_poses(start, release, replace(CONFIG, lift_shape=shape))


@settings(max_examples=40, deadline=None)
@given(span=st.floats(0.02, 0.6), shape=st.sampled_from(["arc", "vertical"]))
def test_path_joins_grasp_and_release_in_small_steps(span: float, shape: str) -> None:
    """The ends are exact and neighbours are no more than a step apart."""
    positions = _carry(span, shape)[:, :3, 3]
    assert positions[0] == pytest.approx([-0.1, 0.05, 0.004], abs=1e-9)
    assert positions[-1] == pytest.approx([-0.1 + span, 0.05, 0.004], abs=1e-9)
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() <= CONFIG.linear_step + 1e-9


@settings(max_examples=40, deadline=None)
@given(span=st.floats(0.02, 0.6))
def test_arc_never_pulls_at_the_crease(span: float) -> None:
    """(x - x_crease)^2 + h^2 <= (S / 2)^2 all the way, so the lower layer is not dragged."""
    positions = _carry(span)[:, :3, 3]
    from_crease = positions[:, 0] + 0.1 - span / 2
    height = positions[:, 2] - 0.004
    assert (from_crease**2 + height**2 <= (span / 2) ** 2 + 1e-9).all()


def test_vertical_path_pulls_at_the_crease() -> None:
    """The paper's plain path breaks that bound, so the bound is worth testing."""
    positions = _carry(0.4, "vertical")[:, :3, 3]
    from_crease = positions[:, 0] + 0.1 - 0.2
    assert (from_crease**2 + (positions[:, 2] - 0.004) ** 2).max() > 0.2**2 * 1.005


@pytest.mark.parametrize("shape", ["arc", "vertical"])
def test_level_part_lies_at_the_lift_height(shape: str) -> None:
    """Between rising and lowering the height is fixed (paper, IV-B item 2)."""
    positions = _carry(0.4, shape)[:, :3, 3]
    middle = positions[np.abs(positions[:, 0] - 0.1) < 0.1]
    assert middle[:, 2] == pytest.approx(CONFIG.lift_height, abs=1e-9)
    assert positions[:, 2].max() <= CONFIG.lift_height + 1e-12


def test_vertical_path_rises_first_and_comes_down_last() -> None:
    """Below half the lift height the plain path stays above its ends (paper, Fig. 5)."""
    positions = _carry(0.4, "vertical")[:, :3, 3]
    low = positions[positions[:, 2] < 0.5 * CONFIG.lift_height]
    from_ends = np.minimum(low[:, 0] + 0.1, 0.3 - low[:, 0])
    assert np.abs(from_ends).max() < 0.003


def test_turn_follows_the_distance_covered() -> None:
    """Position and yaw are interpolated linearly together (paper, IV-B)."""
    poses = _carry(0.3, yaw=0.9)
    yaw = Rotation.from_matrix(poses[:, :3, :3]).as_euler("ZYX")[:, 0]
    assert yaw == pytest.approx(0.9 * (poses[:, 0, 3] + 0.1) / 0.3, abs=1e-9)
    assert np.abs(np.diff(yaw)).max() <= CONFIG.angular_step + 1e-9


def test_turn_takes_the_short_way() -> None:
    """From 170 to -170 degrees the point turns by 20 degrees, not by 340."""
    start = OrientedPoint(np.zeros(3), np.deg2rad(170.0))
    release = OrientedPoint(np.array([0.2, 0.0, 0.0]), np.deg2rad(-170.0))
    poses = carry_poses(start, release, CONFIG)
    turned = Rotation.from_matrix(poses[0, :3, :3].T @ poses[:, :3, :3]).magnitude()
    assert turned.max() == pytest.approx(np.deg2rad(20.0))


def test_release_on_a_pile_stays_above_it() -> None:
    """A release higher than the lift height raises the whole path instead of diving into it."""
    positions = _carry(0.3, end=0.09)[:, :3, 3]
    assert positions[-1, 2] == pytest.approx(0.09)
    assert positions[:, 2].max() >= 0.09


@pytest.mark.parametrize(("span", "shape"), [(0.001, "arc"), (0.2, "spiral")])
def test_unusable_wishes_are_refused(span: float, shape: str) -> None:
    """Too short a displacement and an unknown shape are refused."""
    with pytest.raises(InvalidInputError):
        _carry(span, shape)


def test_lines_of_two_hands_end_together() -> None:
    """Hands with ways of different length share their steps; each goes straight."""
    start = np.stack([np.eye(4), np.eye(4)])
    end = start.copy()
    end[0, 0, 3], end[1, 1, 3] = 0.1, 0.02
    end[1, :3, :3] = Rotation.from_euler("z", 0.3).as_matrix()
    poses = line_poses(start, end, CONFIG)
    assert poses[:, 0] == pytest.approx(start)
    assert poses[:, -1] == pytest.approx(end)
    steps = np.linalg.norm(np.diff(poses[..., :3, 3], axis=1), axis=2)
    assert steps.max() <= CONFIG.linear_step + 1e-12
    assert steps.std(axis=1).max() < 1e-12
