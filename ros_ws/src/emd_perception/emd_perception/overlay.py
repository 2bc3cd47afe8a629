"""A picture that shows what perception found."""

from __future__ import annotations

import cv2
import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray, inverse_transform, transform_points
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import ColourImage, Mask
from emd_perception.pipeline import Perception

_MAGENTA, _YELLOW = (255, 0, 220), (255, 210, 0)
_AXES = (("x", (230, 30, 30)), ("y", (40, 230, 40)))
_FRACTION_BITS = 4  # of the coordinates that OpenCV draws lines between
_TINT_SHARE = 0.3
_TEXT_HEIGHT = 22  # pixels
_AXIS_SHARE = 0.25  # length of a drawn axis, in half extents
_SEGMENTS = 32  # of each side of the square; one piece that leaves the view does not hide the rest


def draw_mask(colour: ColourImage, mask: Mask) -> ColourImage:
    """Tint a mask and draw its outline.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        mask: Shape (H, W).

    Returns:
        Shape (H, W, 3), RGB uint8; a new image.

    Raises:
        InvalidInputError: If the sizes differ.
    """
    if colour.shape[:2] != mask.shape:
        raise InvalidInputError(
            f"image and mask must have the same size, got {colour.shape[:2]} and {mask.shape}"
        )
    picture = colour.astype(np.float32)
    picture[mask] += _TINT_SHARE * (np.array(_MAGENTA, dtype=np.float32) - picture[mask])
    drawn = np.ascontiguousarray(np.rint(picture).astype(np.uint8))
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(drawn, outlines, -1, _MAGENTA, 1)
    return drawn


def draw_overlay(perception: Perception, camera: PinholeCamera) -> ColourImage:
    """Draw mask, field of view, table axes and quality over the colour image.

    Args:
        perception: What was found.
        camera: The camera of its image.

    Returns:
        Shape (H, W, 3), RGB uint8.
    """
    picture = draw_mask(perception.image, perception.mask)
    _draw_field_of_view(
        picture, perception.transform_camera_to_table, perception.voxel_grid.field_of_view, camera
    )
    text = f"quality {perception.quality:.2f}: {perception.reason}"
    picture[-_TEXT_HEIGHT:] //= 4
    place = (8, picture.shape[0] - _TEXT_HEIGHT // 3)
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
    return picture


def _draw_field_of_view(
    picture: ColourImage,
    transform_camera_to_table: FloatArray,
    field_of_view: FieldOfView,
    camera: PinholeCamera,
) -> None:
    transform_table_to_camera = inverse_transform(transform_camera_to_table)
    half = field_of_view.half_extent
    corners = half * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    for start, end in zip(corners[:-1], corners[1:], strict=True):
        _draw_line(picture, start, end, transform_table_to_camera, camera, _YELLOW)
    for axis, (name, colour) in enumerate(_AXES):
        tip = np.zeros(3)
        tip[axis] = _AXIS_SHARE * half
        end_pixel = _draw_line(
            picture, np.zeros(3), tip, transform_table_to_camera, camera, colour, width=2
        )
        if end_pixel is not None:
            cv2.putText(picture, name, end_pixel, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1)


def _draw_line(
    picture: ColourImage,
    start_in_table: FloatArray,
    end_in_table: FloatArray,
    transform_table_to_camera: FloatArray,
    camera: PinholeCamera,
    colour: tuple[int, int, int],
    width: int = 1,
) -> tuple[int, int] | None:
    """Draw what is visible of a straight line; returns the pixel of its end if that is."""
    along = np.linspace(0.0, 1.0, _SEGMENTS + 1)[:, None]
    in_table = start_in_table + along * (end_in_table - start_in_table)
    in_camera = transform_points(transform_table_to_camera, in_table)
    front = in_camera[:, 2] > 0.01
    pixels = camera.project(np.where(front[:, None], in_camera, [0.0, 0.0, 1.0]))
    limit = 4 * np.array([camera.width, camera.height])
    visible = front & (np.abs(pixels) < limit).all(axis=1)
    fixed = np.rint(pixels * 2**_FRACTION_BITS).astype(int)
    for index in range(_SEGMENTS):
        if visible[index] and visible[index + 1]:
            one, other = (tuple(int(value) for value in fixed[index + k]) for k in (0, 1))
            cv2.line(picture, one, other, colour, width, cv2.LINE_AA, _FRACTION_BITS)
    if not visible[-1]:
        return None
    return int(pixels[-1, 0]), int(pixels[-1, 1])
