"""Frames: inverses, and the paper's corners as the camera sees them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import (
    FieldOfView,
    inverse_transform,
    pose_from_transform,
    transform_from_pose,
    transform_points,
)


def test_pose_and_transform_there_and_back_again() -> None:
    """A pose survives the way through its matrix; the inverse undoes it."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        quaternion = Rotation.random(rng=rng).as_quat(canonical=True)
        position = rng.normal(size=3)
        transform = transform_from_pose(position, quaternion)
        position_again, quaternion_again = pose_from_transform(transform)
        assert np.allclose(position_again, position)
        assert np.isclose(abs(quaternion_again @ quaternion), 1)
        points = rng.normal(size=(5, 3))
        there = transform_points(transform, points)
        assert np.allclose(transform_points(inverse_transform(transform), there), points)


def test_cloth_of_0_40_m_spans_1_4_units() -> None:
    """The default scale makes the paper's cloth 0.40 m wide."""
    assert FieldOfView().normalised_from_table(0.40) == pytest.approx(1.4)


@pytest.mark.parametrize("pose", [([0, 0, 0], [0, 0, 0, 0]), ([np.nan, 0, 0], [0, 0, 0, 1])])
def test_poses_without_meaning_are_refused(pose) -> None:
    """NaN and a quaternion of length 0 are refused."""
    with pytest.raises(InvalidInputError):
        transform_from_pose(*pose)


@pytest.mark.parametrize("values", [{"half_extent": 0}, {"height": -1}, {"size": (0, 32, 16)}])
def test_fields_of_view_without_volume_are_refused(values) -> None:
    """Lengths must be positive and counts at least 1."""
    with pytest.raises(InvalidInputError):
        FieldOfView(**values)
