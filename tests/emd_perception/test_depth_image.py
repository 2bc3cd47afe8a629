"""Tests of the conversion and the checks of images."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.depth_image import check_images, depth_in_metres

CAMERA = PinholeCamera(6, 4, 5.0, 5.0, 2.5, 1.5)


def test_both_encodings_give_the_same_metres() -> None:
    """Millimetres as integers and metres as floats are the same image, unknown ones NaN."""
    millimetres = np.array([[0, 1], [850, 4000]], dtype=np.uint16)
    metres = np.array([[np.nan, 0.001], [0.85, 4.0]], dtype=np.float32)
    from_integers = depth_in_metres(millimetres, "16UC1")
    assert from_integers.dtype == np.float32
    np.testing.assert_allclose(from_integers, metres, rtol=1e-6)
    np.testing.assert_array_equal(depth_in_metres(metres, "32FC1"), metres)


def test_what_cannot_be_a_depth_is_unknown() -> None:
    """Zero, negative and infinite metres count as unknown."""
    raw = np.array([[0.0, -1.0, np.inf, np.nan, 1.5]])
    np.testing.assert_array_equal(depth_in_metres(raw), [[np.nan] * 4 + [1.5]])


def test_a_single_last_axis_is_accepted() -> None:
    """A one-channel image may come with its channel axis."""
    assert depth_in_metres(np.ones((4, 6, 1), dtype=np.uint16)).shape == (4, 6)


@pytest.mark.parametrize(
    ("image", "encoding"),
    [
        (np.ones((4, 6), np.uint8), None),
        (np.ones((4, 6, 3), np.uint16), None),
        (np.ones((4, 6), np.int32), None),
        (np.ones((4, 6), np.uint16), "32FC1"),
        (np.ones((4, 6), np.float32), "16UC1"),
        (np.ones((4, 6), np.uint8), "mono8"),
    ],
)
def test_other_images_are_refused(image, encoding) -> None:
    """Anything but a one-channel 16-bit or float image is refused."""
    with pytest.raises(InvalidInputError):
        depth_in_metres(image, encoding)


@pytest.mark.parametrize(
    ("colour", "depth", "complaint"),
    [
        (np.zeros((4, 6, 4), np.uint8), np.ones((4, 6), np.float32), "RGB"),
        (np.zeros((4, 6), np.uint8), np.ones((4, 6), np.float32), "RGB"),
        (np.zeros((4, 6, 3), np.float32), np.ones((4, 6), np.float32), "RGB"),
        (np.zeros((4, 6, 3), np.uint8), np.ones((4, 6), np.uint16), "metres"),
        (np.zeros((4, 6, 3), np.uint8), np.ones((2, 3), np.float32), "same size"),
        (np.zeros((2, 3, 3), np.uint8), np.ones((2, 3), np.float32), "intrinsics"),
        (np.zeros((4, 6, 3), np.uint8), np.full((4, 6), np.nan, np.float32), "no valid"),
    ],
)
def test_images_that_do_not_belong_together_are_refused(colour, depth, complaint) -> None:
    """Wrong channels, types, sizes and an empty depth are told apart."""
    with pytest.raises(InvalidInputError, match=complaint):
        check_images(colour, depth, CAMERA)
