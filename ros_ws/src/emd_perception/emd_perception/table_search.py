"""Finding the table: first roughly in the whole view, then exactly beside the cloth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import PlaneConfig
from emd_perception.image_types import DepthImage, Mask
from emd_perception.mask_morphology import dilate
from emd_perception.quality import Judgement, good
from emd_perception.table_frame import (
    plane_from_transform,
    refine_table_frame,
    table_frame_from_plane,
)
from emd_perception.table_plane import TablePlane, fit_plane_to_pixels, fit_table_plane
from emd_perception.unprojection import pixel_rays, pixels_near_plane, unproject_mask

_MIN_PIXELS = 1000
_BARE = 0.03  # metres from the rough plane; bare table, a sensor's distortion included
_OUTLINE_MARGIN = 9  # pixels; depth near the outline mixes cloth and table


@dataclass(frozen=True)
class TableFrame:
    """Where the table is.

    Attributes:
        plane: The measured table.
        transform_camera_to_table: Shape (4, 4), metres.
        judgements: How far to trust both.
        notes: What was assumed for want of extrinsics.
    """

    plane: TablePlane
    transform_camera_to_table: FloatArray
    judgements: tuple[Judgement, ...]
    notes: tuple[str, ...]


def find_table(
    depth: DepthImage,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None,
    config: PlaneConfig,
) -> TablePlane:
    """Find the table roughly; where extrinsics are known, near the place that they say.

    Raises:
        InvalidInputError: If too few pixels have a depth.
    """
    if transform_camera_to_table is None:
        return fit_table_plane(depth, camera, config)
    expected = plane_from_transform(transform_camera_to_table)
    near = pixels_near_plane(depth, expected, camera, 2.0 * config.max_offset)
    if len(near) < max(_MIN_PIXELS, 0.1 * np.count_nonzero(np.isfinite(depth))):
        return fit_table_plane(depth, camera, config)
    return fit_plane_to_pixels(depth, camera, near, config, expected)


def locate_table_frame(
    depth: DepthImage,
    rough: TablePlane,
    cloth_mask: Mask,
    region: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None,
    config: PlaneConfig,
) -> TableFrame:
    """Measure the table beside the cloth, and place the table frame on it.

    Args:
        depth: Shape (H, W), metres, NaN where unknown.
        rough: What `find_table` found.
        cloth_mask: The cloth's pixels, shape (H, W).
        region: Pixels of interest; the table is measured there if enough of it is bare, because
            a depth camera's distortion makes a plane measured far away wrong by millimetres here.
        camera: The camera of the depth image.
        transform_camera_to_table: Extrinsics, if known.
        config: Thresholds.
    """
    around = ~dilate(cloth_mask, 2 * _OUTLINE_MARGIN + 1)
    beside = pixels_near_plane(depth, rough.coefficients, camera, _BARE, around & region)
    if len(beside) < _MIN_PIXELS:
        bare = pixels_near_plane(depth, rough.coefficients, camera, _BARE, around)
        plane, measured = rough, len(bare) >= _MIN_PIXELS
    else:
        plane = fit_plane_to_pixels(depth, camera, beside, config, rough.coefficients)
        measured = True
    judgements = [
        Judgement(1.0 if measured else 0.5, "too little bare table to measure its plane"),
        Judgement(
            good(plane.inlier_share, 0.3, config.min_inlier_share),
            f"only {plane.inlier_share:.0%} of the table's depth lies on a plane",
        ),
    ]
    if transform_camera_to_table is None:
        transform = table_frame_from_plane(plane, _centre(depth, cloth_mask, plane, camera))
        note = "no extrinsics: the table frame's origin lies under the middle of the cloth"
        return TableFrame(plane, transform, tuple(judgements), (note,))
    refined = refine_table_frame(transform_camera_to_table, plane, config)
    complaint = (
        f"the measured table is tilted by {np.degrees(refined.tilt):.1f} degrees and "
        f"{1e3 * refined.offset:.0f} mm off the extrinsics; calibrate the camera's pose"
    )
    judgements.append(Judgement(1.0 if refined.agrees else 0.3, complaint))
    return TableFrame(plane, refined.transform_camera_to_table, tuple(judgements), ())


def _centre(depth: DepthImage, mask: Mask, plane: TablePlane, camera: PinholeCamera) -> FloatArray:
    """Centroid of the cloth; without any depth, of its rays where they meet the table.

    Pixels count by the area of table that they cover, which grows with the cube of the distance.
    """
    points = unproject_mask(depth, mask, camera)
    if len(points) == 0:
        rays = pixel_rays(camera)[mask]
        points = rays * (plane.coefficients[3] / -(rays @ plane.normal))[:, None]
    return np.average(points, axis=0, weights=points[:, 2] ** 3)
