"""Perception as a whole: colour and depth in, the cloth's voxel grid out (paper, IV-B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid
from emd_perception.config import PerceptionConfig
from emd_perception.depth_image import check_images
from emd_perception.depth_to_voxel import ClothPoints, cloth_points, voxelise_cloth
from emd_perception.fusion import FusedFrame, fuse_frames
from emd_perception.image_types import ColourImage, Mask
from emd_perception.open3d_library import load_open3d
from emd_perception.quality import Judgement, combine, good
from emd_perception.region import field_of_view_region, observed_region, pixel_area_on_table
from emd_perception.segmentation import Segmentation, segment_cloth
from emd_perception.stopwatch import Stopwatch
from emd_perception.table_frame import check_transform
from emd_perception.table_plane import TablePlane
from emd_perception.table_search import find_table, locate_table_frame
from emd_perception.unprojection import height_above_plane

# Points are thinned out to this share of a voxel's side before they are averaged in cells.
_POINT_SPACING = 0.25


@dataclass(frozen=True)
class Perception:
    """What was seen of the cloth.

    Attributes:
        mask: The cloth's pixels, shape (H, W).
        quality: How far to trust it, 0..1.
        reason: What lowers the quality, worst first; "cloth found" if nothing does.
        table_plane: Measured table, shape (4,): a, b, c, d in the camera optical frame, metres;
            unit normal towards the camera.
        transform_camera_to_table: Shape (4, 4), metres; z = 0 is the measured table.
        points_in_table: The cloth's surface, averaged and cleaned, shape (N, 3), metres.
        colours: Colours of these points, shape (N, 3), RGB uint8.
        voxel_grid: The cloth's state for the network.
        cloth_area: Square metres on the table.
        motion_share: Share of the region that moved between the frames, 0..1.
        notes: Choices that were made for want of better knowledge.
        milliseconds: Time of each stage, and of all as `total`.
        image: The colour image that all this refers to (the mean of several frames).
    """

    mask: Mask
    quality: float
    reason: str
    table_plane: FloatArray
    transform_camera_to_table: FloatArray
    points_in_table: FloatArray
    colours: NDArray[np.uint8]
    voxel_grid: VoxelGrid
    cloth_area: float
    motion_share: float
    notes: tuple[str, ...]
    milliseconds: dict[str, float]
    image: ColourImage = field(repr=False)


def perceive(
    colour: ColourImage,
    depth: NDArray[np.float32],
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None = None,
    config: PerceptionConfig | None = None,
    field_of_view: FieldOfView | None = None,
) -> Perception:
    """Perceive the cloth in one frame; see `perceive_frames`."""
    return perceive_frames(
        [colour], [depth], camera, transform_camera_to_table, config, field_of_view
    )


def perceive_frames(
    colours: Sequence[ColourImage],
    depths: Sequence[NDArray[np.float32]],
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None = None,
    config: PerceptionConfig | None = None,
    field_of_view: FieldOfView | None = None,
) -> Perception:
    """Perceive the cloth in several frames of a scene at rest (paper, IV-B).

    GraphCut finds the cloth in colour, depth gives its pixels their 3D points, and the points are
    rasterised. The table's plane, measured beside the cloth, sets where heights begin. The same
    input gives the same output.

    Args:
        colours: Each of shape (H, W, 3), RGB uint8; in order of time.
        depths: As many, each of shape (H, W), metres, NaN where unknown, registered to colour.
        camera: The camera of all images.
        transform_camera_to_table: Extrinsics, shape (4, 4), metres; their tilt and height are
            corrected by the measured table. If None, the table frame lies under the cloth.
        config: Settings; the defaults if None.
        field_of_view: Box of the voxel grid. If None, the default one; without extrinsics it is
            enlarged where the cloth does not fit, and `notes` says so.

    Raises:
        InvalidInputError: If the images do not have the forms wanted or do not fit together.
        NoClothError: If nothing in view can be cloth.
    """
    settings = config or PerceptionConfig()
    for colour, depth in zip(colours, depths, strict=False):
        check_images(colour, depth, camera)
    if transform_camera_to_table is not None:
        check_transform(transform_camera_to_table)
    load_open3d()  # once a process; its second is no part of perception
    clock = Stopwatch()
    with clock.stage("fusion"):
        frame = fuse_frames(colours, depths, settings.fusion)
    with clock.stage("plane"):
        table = find_table(frame.depth, camera, transform_camera_to_table, settings.plane)
    with clock.stage("segmentation"):
        region = _region(frame, table, camera, transform_camera_to_table, settings, field_of_view)
        segmentation = _segment(frame, table, camera, region, settings)
    with clock.stage("table_frame"):
        table_frame = locate_table_frame(
            frame.depth,
            table,
            segmentation.mask,
            region,
            camera,
            transform_camera_to_table,
            settings.plane,
        )
    with clock.stage("voxelisation"):
        wanted = field_of_view or FieldOfView()
        cloth = cloth_points(
            frame.colour,
            frame.depth,
            segmentation.mask,
            camera,
            table_frame.transform_camera_to_table,
            _POINT_SPACING * float(wanted.resolution[0]),
            settings.voxel,
        )
        may_enlarge = field_of_view is None and transform_camera_to_table is None
        fitting, notes = _fit_field_of_view(cloth, wanted, may_enlarge)
        grid = voxelise_cloth(cloth, fitting, settings.voxel)
    motion = frame.motion_share(region)
    quality, reason = combine(
        [
            *segmentation.judgements,
            *table_frame.judgements,
            *_judge(cloth, fitting, motion, settings),
        ]
    )
    return Perception(
        mask=segmentation.mask,
        quality=quality,
        reason=reason,
        table_plane=table_frame.plane.coefficients,
        transform_camera_to_table=table_frame.transform_camera_to_table,
        points_in_table=cloth.points_in_table,
        colours=cloth.colours,
        voxel_grid=grid,
        cloth_area=segmentation.area,
        motion_share=motion,
        notes=(*table_frame.notes, *notes),
        milliseconds=clock.milliseconds(),
        image=frame.colour,
    )


def _region(
    frame: FusedFrame,
    table: TablePlane,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None,
    config: PerceptionConfig,
    field_of_view: FieldOfView | None,
) -> Mask:
    """Pixels in which cloth is looked for."""
    height = height_above_plane(frame.depth, table.coefficients, camera)
    region = observed_region(height)
    if transform_camera_to_table is not None:
        region &= field_of_view_region(
            camera,
            transform_camera_to_table,
            field_of_view or FieldOfView(),
            config.segmentation.region_margin,
        )
    return region


def _segment(
    frame: FusedFrame,
    table: TablePlane,
    camera: PinholeCamera,
    region: Mask,
    config: PerceptionConfig,
) -> Segmentation:
    height = height_above_plane(frame.depth, table.coefficients, camera)
    area = pixel_area_on_table(camera, table)
    return segment_cloth(frame.colour, height, area, region, config.segmentation)


def _fit_field_of_view(
    cloth: ClothPoints, wanted: FieldOfView, may_enlarge: bool
) -> tuple[FieldOfView, tuple[str, ...]]:
    """Enlarge the field of view to hold the cloth and a free column around it, if allowed."""
    free_share = 1.0 - 2.0 / min(wanted.size[:2])
    needed = float(np.abs(cloth.footprint_in_table).max()) / free_share
    if not may_enlarge or needed <= wanted.half_extent:
        return wanted, ()
    note = (
        f"the cloth does not fit the field of view of half extent {wanted.half_extent:.3f} m, "
        f"enlarged to {needed:.3f} m"
    )
    return FieldOfView(needed, wanted.height, wanted.size), (note,)


def _judge(
    cloth: ClothPoints, field_of_view: FieldOfView, motion_share: float, config: PerceptionConfig
) -> tuple[Judgement, ...]:
    beyond = (np.abs(cloth.footprint_in_table) > field_of_view.half_extent).any(axis=1).mean()
    limit = config.fusion.max_motion_share
    return (
        Judgement(
            good(cloth.known_share, 0.2, 0.6),
            f"only {cloth.known_share:.0%} of the cloth's pixels have a depth",
        ),
        Judgement(
            good(float(beyond), 0.5, 0.02),
            f"{beyond:.0%} of the cloth lies outside the field of view, where the grid wraps",
        ),
        Judgement(
            1.0 if motion_share <= limit else 0.2,
            f"{motion_share:.0%} of the view moved between the frames; wait until it rests",
        ),
    )
