"""Lens distortion: taken out, put in, refused."""

import cv2
import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.lens import ColourRectifier, distort_points, pixel_directions

CAMERA = PinholeCamera(160, 120, 131.0, 133.0, 78.0, 61.0)
LENSES = [
    LensDistortion(),
    LensDistortion("plumb_bob", (0.12, -0.25, 0.001, -0.002, 0.08)),
    LensDistortion("plumb_bob", (0.12, -0.25, 0.001, -0.002)),
    LensDistortion("rational_polynomial", (0.3, -0.2, 0.001, -0.001, 0.05, 0.2, -0.1, 0.01)),
    LensDistortion("equidistant", (0.08, -0.02, 0.003, 0.001)),
]


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: f"{lens.model}{len(lens.coefficients)}")
def test_there_and_back_again(lens) -> None:
    """The direction in which a pixel looks is seen at that pixel."""
    directions = pixel_directions(CAMERA, lens)
    pixels = distort_points(directions.reshape(-1, 2), CAMERA, lens).reshape(120, 160, 2)
    wanted = np.stack(np.meshgrid(np.arange(160), np.arange(120)), axis=-1)
    np.testing.assert_allclose(pixels, wanted, atol=1e-4)


def test_without_a_lens_directions_are_the_pinhole_cameras() -> None:
    """The same rays as unprojection at depth 1."""
    rays = CAMERA.unproject(np.ones((120, 160)))
    np.testing.assert_allclose(pixel_directions(CAMERA, LensDistortion()), rays[..., :2])


@pytest.mark.parametrize("lens", LENSES[1:], ids=lambda lens: lens.model)
def test_a_straight_line_becomes_straight_again(lens) -> None:
    """A line painted into the distorted picture lies on a straight line in the rectified one."""
    x = np.linspace(-0.45, 0.45, 400)
    line = np.column_stack([x, 0.3 + 0.1 * x])
    picture = np.zeros((120, 160, 3), np.uint8)
    for column, row in np.rint(distort_points(line, CAMERA, lens)).astype(int):
        if 0 <= column < 160 and 0 <= row < 120:
            picture[row, column] = 255
    straight = ColourRectifier(CAMERA, lens).rectify(picture)
    rows, columns = np.nonzero(straight[..., 0] > 120)
    wanted = (0.3 + 0.1 * (columns - CAMERA.cx) / CAMERA.fx) * CAMERA.fy + CAMERA.cy
    assert len(rows) > 80
    assert np.abs(rows - wanted).max() < 1.6


def test_a_lens_that_bends_nothing_leaves_the_picture_alone() -> None:
    """No copy, no interpolation."""
    picture = np.zeros((120, 160, 3), np.uint8)
    assert ColourRectifier(CAMERA, LensDistortion("plumb_bob", (0.0,) * 5)).rectify(picture) is (
        picture
    )


def test_rectification_is_opencvs() -> None:
    """The same picture as cv2.undistort makes with the same K."""
    lens = LENSES[1]
    picture = np.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    picture = cv2.GaussianBlur(picture, (5, 5), 0)
    k = np.array([[131.0, 0, 78.0], [0, 133.0, 61.0], [0, 0, 1]])
    wanted = cv2.undistort(picture, k, np.array(lens.coefficients))
    ours = ColourRectifier(CAMERA, lens).rectify(picture)
    assert np.abs(ours.astype(int) - wanted).max() <= 4


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("fov", (0.1,)),
        ("plumb_bob", (0.1, 0.2)),
        ("equidistant", (0.1,) * 5),
        ("plumb_bob", (0.1, 0.2, 0.0, 0.0, float("nan"))),
    ],
)
def test_unknown_distortion_is_refused(model, coefficients) -> None:
    """Model, count and values are checked."""
    with pytest.raises(InvalidInputError):
        LensDistortion(model, coefficients)
