"""The settings of perception; every default lives here and only here."""

from __future__ import annotations

from dataclasses import dataclass, field

from emd_core.errors import InvalidInputError
from emd_core.value_ranges import bounded, check_ranges


def _require(condition: bool, config: object, name: str, wanted: str) -> None:
    if not condition:
        raise InvalidInputError(
            f"{type(config).__name__}.{name} must be {wanted}, got {getattr(config, name)}"
        )


@dataclass(frozen=True)
class SegmentationConfig:
    """How GraphCut separates the cloth from the table (paper, IV-B).

    Colours are CIE L*a*b* units, lengths metres on the table.

    Attributes:
        working_pixels: The picture is reduced to at most so many pixels for the first cut.
        iterations: Rounds of model fitting and cutting on the reduced picture.
        refined_band: Half width of the band along the first outline that is cut again at full
            resolution, pixels of the reduced picture; 0 leaves the first cut as it is.
        chroma_gain: Stretch of a* and b* against L* before the cut: the table's grain and the
            shadows live in L*.
        chroma_floor: Least spread of the table's a* and b* that is assumed.
        lightness_floor: Least spread of the table's L* that is assumed; wide, because a shadow
            changes L* alone.
        height_floor: Least spread of the table's measured height about its trend that is assumed.
        border_share: The table's colour is learnt from this share of the region, nearest its rim.
        min_contrast: Least distance of the cloth from the table, in spreads of the table.
        max_contrast: Largest seed threshold, in spreads of the table.
        max_height: What stands higher above the table is no cloth (a hand, a box).
        max_height_step: A jump of height larger than this separates things, not folds.
        min_area: Smallest cloth, square metres.
        max_area: Largest cloth, square metres.
        max_hole_area: Smaller holes in the cloth are filled, square metres.
        min_quality: A mask of lower quality counts as no cloth.
        region_margin: The region of interest exceeds the field of view by this share.
        most_uses: In a stream, an outline serves at most so many more frames while the scene
            looks the same; 0: it is found in every frame.
        random_seed: Seed of GraphCut's colour clustering.
    """

    working_pixels: int = bounded(160 * 120, 1024, 10_000_000)
    iterations: int = bounded(2, 1, 100)
    refined_band: int = bounded(1, 0, 100)
    chroma_gain: float = bounded(2.5, 0.01, 100.0)
    chroma_floor: float = bounded(2.0, 0.01, 100.0)
    lightness_floor: float = bounded(16.0, 0.01, 100.0)
    height_floor: float = bounded(0.0006, 1e-5, 0.1)
    border_share: float = bounded(0.6, 0.0, 1.0)
    min_contrast: float = bounded(3.5, 0.1, 100.0)
    max_contrast: float = bounded(5.0, 0.1, 100.0)
    max_height: float = bounded(0.09, 0.001, 1.0)
    max_height_step: float = bounded(0.025, 0.001, 1.0)
    min_area: float = bounded(0.004, 1e-6, 10.0)
    max_area: float = bounded(1.5, 1e-6, 100.0)
    max_hole_area: float = bounded(0.002, 1e-6, 10.0)
    min_quality: float = bounded(0.2, 0.0, 1.0)
    region_margin: float = bounded(0.2, 0.0, 10.0)
    most_uses: int = bounded(30, 0, 100_000)
    random_seed: int = bounded(0, 0, 2**31 - 1)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)
        _require(
            self.max_contrast >= self.min_contrast, self, "max_contrast", "min_contrast or up"
        )
        _require(self.max_area > self.min_area, self, "max_area", "above min_area")


@dataclass(frozen=True)
class PlaneConfig:
    """How the table's plane is found in the depth image.

    Attributes:
        distance_threshold: Points so near to a plane support it, metres.
        iterations: Planes that RANSAC tries.
        max_points: Pixels that take part; more are thinned out evenly.
        min_inlier_share: Least share of the table's pixels on the plane.
        max_tilt: Largest angle between the measured plane and the known extrinsics, radians;
            beyond it the extrinsics are kept and the quality falls.
        max_offset: Largest difference of height between both, metres.
        random_seed: Seed of RANSAC.
    """

    distance_threshold: float = bounded(0.008, 1e-4, 0.1)
    iterations: int = bounded(100, 1, 100_000)
    max_points: int = bounded(2000, 100, 10_000_000)
    min_inlier_share: float = bounded(0.5, 0.0, 1.0)
    max_tilt: float = bounded(0.08, 1e-4, 1.6)
    max_offset: float = bounded(0.03, 1e-4, 1000.0)
    random_seed: int = bounded(0, 0, 2**31 - 1)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class VoxelConfig:
    """How the masked depth becomes points and voxels.

    Attributes:
        max_cells_per_voxel: Each voxel column is divided into at most this many cells a side, and
            the points of a cell are averaged before rasterisation. The paper's rule, "one vertex
            suffices", is meant for a mesh without noise; on single pixels it takes the highest
            error.
        max_cell_error: Cells are so wide that the standard error of their height is at most this,
            metres.
        max_spike: Pixels farther than this from the median of their surroundings are dropped,
            metres.
        max_lone_height: Thinned-out points are dropped whose height differs by more from that of
            all but one of the points around them, metres.
        min_points_in_cell: Wide cells with fewer thinned-out points are left out.
        min_coverage: Columns that the cloth's pixels cover by a smaller share are empty: the
            outline errs by about a pixel.
        max_hidden_share: Columns of whose pixels a hand or another thing in view hides a larger
            share, and more than show cloth, are unknown.
    """

    max_cells_per_voxel: int = bounded(4, 1, 64)
    max_cell_error: float = bounded(0.0004, 1e-6, 1.0)
    max_spike: float = bounded(0.02, 1e-4, 1.0)
    max_lone_height: float = bounded(0.012, 1e-4, 1.0)
    min_points_in_cell: int = bounded(2, 1, 1000)
    min_coverage: float = bounded(0.02, 0.0, 1.0)
    max_hidden_share: float = bounded(0.1, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class FusionConfig:
    """How several frames of a scene at rest become one.

    Attributes:
        frames: Frames that are averaged.
        trimmed_share: Share of a pixel's values that is dropped at each end before averaging.
        min_valid_share: A pixel needs a depth in at least this share of the frames.
        motion_depth: Change of smoothed depth that counts as motion, metres.
        motion_colour: Change of smoothed grey value that counts as motion, 0..255.
        max_motion_share: More moving pixels than this share of the region spoil the average.
    """

    frames: int = bounded(10, 1, 1000)
    trimmed_share: float = bounded(0.2, 0.0, 0.49)
    min_valid_share: float = bounded(0.3, 0.0, 1.0)
    motion_depth: float = bounded(0.012, 1e-4, 1.0)
    motion_colour: float = bounded(16.0, 0.1, 255.0)
    max_motion_share: float = bounded(0.01, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class PerceptionConfig:
    """All settings of perception.

    Attributes:
        segmentation: GraphCut and what counts as cloth.
        plane: The table's plane.
        voxel: From masked depth to voxels.
        fusion: Averaging of frames.
    """

    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    plane: PlaneConfig = field(default_factory=PlaneConfig)
    voxel: VoxelConfig = field(default_factory=VoxelConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
