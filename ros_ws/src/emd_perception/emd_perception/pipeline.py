"""Perception as a whole: colour and depth in, the cloth's voxel grid out (paper, IV-B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid
from emd_perception.cloth_points import ClothPoints, cloth_points
from emd_perception.config import PerceptionConfig
from emd_perception.depth_image import check_images
from emd_perception.depth_to_voxel import voxelise_cloth
from emd_perception.fusion import FusedFrame, fuse_frames
from emd_perception.glance import Glance
from emd_perception.hidden_columns import hidden_columns
from emd_perception.image_types import ColourImage, DepthImage, Mask
from emd_perception.open3d_library import load_open3d
from emd_perception.perception import Perception
from emd_perception.quality import Judgement, combine, good
from emd_perception.region import field_of_view_region, observed_region, pixel_area_on_table
from emd_perception.segmentation import Segmentation, segment_cloth
from emd_perception.stopwatch import Stopwatch
from emd_perception.stream_memory import FoundOutline, StreamMemory
from emd_perception.table_frame import check_transform
from emd_perception.table_search import find_table, locate_table_frame
from emd_perception.unprojection import height_above_plane

# Points are thinned out to this share of a voxel's side before they are averaged in cells.
_POINT_SPACING = 0.25


@dataclass(frozen=True)
class _View:
    """From where and how the cloth is seen; None where the caller left the choice."""

    camera: PinholeCamera
    transform_camera_to_table: FloatArray | None
    config: PerceptionConfig
    chosen_field_of_view: FieldOfView | None
    last: StreamMemory | None = None

    @property
    def field_of_view(self) -> FieldOfView:
        return self.chosen_field_of_view or FieldOfView()

    @property
    def may_enlarge(self) -> bool:
        return self.chosen_field_of_view is None and self.transform_camera_to_table is None


@dataclass(frozen=True)
class _VoxelisedCloth:
    points: ClothPoints
    grid: VoxelGrid
    notes: tuple[str, ...]


def perceive(
    colour: ColourImage,
    depth: DepthImage,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None = None,
    config: PerceptionConfig | None = None,
    field_of_view: FieldOfView | None = None,
    last: StreamMemory | None = None,
) -> Perception:
    """Perceive the cloth in one frame; see `perceive_frames`."""
    return perceive_frames(
        [colour], [depth], camera, transform_camera_to_table, config, field_of_view, last
    )


def perceive_frames(
    colours: Sequence[ColourImage],
    depths: Sequence[DepthImage],
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray | None = None,
    config: PerceptionConfig | None = None,
    field_of_view: FieldOfView | None = None,
    last: StreamMemory | None = None,
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
        last: `memory` of the frame before in a stream, which had the same settings. While the
            scene looks the same, its outline is kept for `segmentation.most_uses` frames, and
            longer what it taught of the colours; depth is always that of the frame.

    Raises:
        InvalidInputError: If the images do not have the forms wanted or do not fit together.
        NoClothError: If nothing in view can be cloth.
    """
    for colour, depth in zip(colours, depths, strict=False):
        check_images(colour, depth, camera)
    if transform_camera_to_table is not None:
        check_transform(transform_camera_to_table)
    load_open3d()  # once a process; its second is no part of perception
    settings = config or PerceptionConfig()
    view = _View(camera, transform_camera_to_table, settings, field_of_view, last)
    clock = Stopwatch()
    with clock.stage("fusion"):
        frame = fuse_frames(colours, depths, settings.fusion)
    return _perceive_fused(frame, view, clock)


def _perceive_fused(frame: FusedFrame, view: _View, clock: Stopwatch) -> Perception:
    known_pose, config = view.transform_camera_to_table, view.config
    memory = _outline(frame, view, clock)
    segmentation, region = memory.outline.segmentation, memory.outline.region
    with clock.stage("table_frame"):
        table = locate_table_frame(
            frame.depth,
            memory.outline.table,
            segmentation.mask,
            region,
            view.camera,
            known_pose,
            config.plane,
        )
    with clock.stage("voxelisation"):
        cloth = _voxelise(frame, segmentation, table.transform_camera_to_table, view)
    motion = frame.motion_share(region)
    judgements = [*segmentation.judgements, *table.judgements, *_judge(cloth, motion, config)]
    quality, reason = combine(judgements)
    return Perception(
        mask=segmentation.mask,
        quality=quality,
        reason=reason,
        table_plane=table.plane.coefficients,
        transform_camera_to_table=table.transform_camera_to_table,
        points_in_table=cloth.points.points_in_table,
        colours=cloth.points.colours,
        voxel_grid=cloth.grid,
        cloth_area=segmentation.area,
        motion_share=motion,
        notes=(*table.notes, *cloth.notes),
        milliseconds=clock.milliseconds(),
        image=frame.colour,
        memory=memory,
    )


def _outline(frame: FusedFrame, view: _View, clock: Stopwatch) -> StreamMemory:
    """Find the cloth's outline, or keep that of a scene which has not changed."""
    last, config = view.last, view.config
    known_pose = view.transform_camera_to_table
    with clock.stage("glance"):
        glance = Glance.of(frame.colour, frame.depth, config.segmentation.working_pixels)
        if last and last.still_holds(glance, known_pose, config.segmentation.most_uses):
            return replace(last, uses=last.uses + 1)
    with clock.stage("plane"):
        table = find_table(frame.depth, view.camera, known_pose, config.plane)
    with clock.stage("segmentation"):
        height = height_above_plane(frame.depth, table.coefficients, view.camera)
        region = _region(height, view)
        area = pixel_area_on_table(view.camera, table)
        segmentation = segment_cloth(
            frame.colour,
            height,
            area,
            region,
            config.segmentation,
            last.outline.segmentation.memory if last else None,
        )
    return StreamMemory(FoundOutline(table, region, segmentation), glance, known_pose)


def _region(height: DepthImage, view: _View) -> Mask:
    """Pixels in which cloth is looked for, given their heights above the table, shape (H, W)."""
    region = observed_region(height)
    if view.transform_camera_to_table is None:
        return region
    return region & field_of_view_region(
        view.camera,
        view.transform_camera_to_table,
        view.field_of_view,
        view.config.segmentation.region_margin,
    )


def _voxelise(
    frame: FusedFrame, seen: Segmentation, transform_camera_to_table: FloatArray, view: _View
) -> _VoxelisedCloth:
    points = cloth_points(
        frame.colour,
        frame.depth,
        seen.mask,
        view.camera,
        transform_camera_to_table,
        _POINT_SPACING * float(view.field_of_view.resolution[0]),
        view.config.voxel,
    )
    field_of_view, notes = _fit_field_of_view(points, view)
    grid = voxelise_cloth(points, field_of_view, view.config.voxel)
    unknown = hidden_columns(
        seen.hiding,
        seen.mask,
        view.camera,
        transform_camera_to_table,
        field_of_view,
        view.config.voxel,
    )
    grid = replace(grid, unknown=unknown)
    if grid.unknown_count:
        note = f"{grid.unknown_count} columns are unknown: something tall or too near hides them"
        notes = (*notes, note)
    return _VoxelisedCloth(points, grid, notes)


def _fit_field_of_view(cloth: ClothPoints, view: _View) -> tuple[FieldOfView, tuple[str, ...]]:
    """Enlarge the field of view to hold the cloth and a free column around it, if allowed."""
    wanted = view.field_of_view
    if not view.may_enlarge:
        return wanted, ()
    free_share = 1.0 - 2.0 / min(wanted.size[:2])
    needed = float(np.abs(cloth.footprint_in_table).max()) / free_share
    if needed <= wanted.half_extent:
        return wanted, ()
    note = (
        f"the cloth does not fit the field of view of half extent {wanted.half_extent:.3f} m, "
        f"enlarged to {needed:.3f} m"
    )
    return FieldOfView(needed, wanted.height, wanted.size), (note,)


def _judge(
    cloth: _VoxelisedCloth, motion_share: float, config: PerceptionConfig
) -> tuple[Judgement, ...]:
    """Judge the depth's completeness, the place of the cloth, and the rest of the scene."""
    known = cloth.points.known_share
    half = cloth.grid.field_of_view.half_extent
    x, y = cloth.points.footprint_in_table.T
    beyond = float(np.mean((np.abs(x) > half) | (np.abs(y) > half)))
    still = motion_share <= config.fusion.max_motion_share
    return (
        Judgement(good(known, 0.2, 0.6), f"only {known:.0%} of the cloth's pixels have a depth"),
        Judgement(
            good(beyond, 0.5, 0.02),
            f"{beyond:.0%} of the cloth lies outside the field of view, where the grid wraps",
        ),
        Judgement(
            1.0 if still else 0.2,
            f"{motion_share:.0%} of the view moved between the frames; wait until it rests",
        ),
    )
