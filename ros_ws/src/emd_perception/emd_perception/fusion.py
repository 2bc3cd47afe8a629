"""Several frames of a scene at rest become one, with less noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from emd_core.errors import InvalidInputError
from emd_perception.config import FusionConfig
from emd_perception.image_types import ColourImage, DepthImage, Mask
from emd_perception.table_appearance import smooth_height


@dataclass(frozen=True)
class FusedFrame:
    """One frame made of several.

    Attributes:
        colour: Mean colour, shape (H, W, 3), RGB uint8.
        depth: Trimmed mean of the depth, shape (H, W), metres, NaN where too few frames know it.
        moving: Pixels that changed between the first and the last frames, shape (H, W).
    """

    colour: ColourImage
    depth: DepthImage
    moving: Mask

    def motion_share(self, region: Mask) -> float:
        """Share of a region's pixels that moved, 0..1; 0 for an empty region."""
        return int(np.count_nonzero(self.moving & region)) / max(int(np.count_nonzero(region)), 1)


def fuse_frames(
    colours: Sequence[ColourImage],
    depths: Sequence[DepthImage],
    config: FusionConfig | None = None,
) -> FusedFrame:
    """Average frames of a scene at rest, and mark what moved meanwhile.

    Args:
        colours: Each of shape (H, W, 3), RGB uint8; in order of time.
        depths: As many, each of shape (H, W), metres, NaN where unknown.
        config: Trimming and motion thresholds; the defaults if None.

    Raises:
        InvalidInputError: If there is no frame, the counts differ, or the sizes differ.
    """
    settings = config or FusionConfig()
    _check(colours, depths)
    if len(depths) == 1:
        still = np.zeros(depths[0].shape, dtype=bool)
        return FusedFrame(colours[0], depths[0], still)
    colour = np.mean(colours, axis=0, dtype=np.float32)
    return FusedFrame(
        np.rint(colour).astype(np.uint8),
        trimmed_mean(np.stack(depths), settings),
        _moving_pixels(colours, depths, settings),
    )


def trimmed_mean(depths: DepthImage, config: FusionConfig) -> DepthImage:
    """Mean of each pixel's known values without the lowest and the highest.

    Unlike a median it averages the sensor's depth steps (2.9 mm at 1 m) away, and unlike a mean
    it ignores single wild values.

    Args:
        depths: Shape (F, H, W), metres, NaN where unknown.
        config: Share to trim at each end, and share of frames that must know the pixel.

    Returns:
        Shape (H, W), metres, NaN where too few frames know the pixel.
    """
    frames = len(depths)
    ordered = np.sort(depths, axis=0)  # NaN comes last
    known = np.isfinite(ordered).sum(axis=0)
    trimmed = np.floor(config.trimmed_share * known).astype(int)
    total = np.zeros(depths.shape[1:])
    for rank in range(frames):
        kept = (rank >= trimmed) & (rank < known - trimmed)
        total += np.where(kept, ordered[rank], 0.0)
    enough = known >= max(1, int(np.ceil(config.min_valid_share * frames)))
    mean = total / np.maximum(known - 2 * trimmed, 1)
    return np.where(enough, mean, np.nan).astype(np.float32)


def _moving_pixels(
    colours: Sequence[ColourImage], depths: Sequence[DepthImage], config: FusionConfig
) -> Mask:
    """Compare the first third of the frames with the last third, smoothed, and first with last."""
    third = max(1, len(depths) // 3)
    first, last = (
        smooth_height(_nan_mean(part), side=9) for part in (depths[:third], depths[-third:])
    )
    moved = np.abs(last - first) > config.motion_depth
    first_grey, last_grey = (
        cv2.blur(np.mean([cv2.cvtColor(one, cv2.COLOR_RGB2GRAY) for one in part], axis=0), (5, 5))
        for part in (colours[:third], colours[-third:])
    )
    # A camera's automatic exposure changes the whole picture; a motion changes a part of it.
    change = last_grey - first_grey
    moved |= np.abs(change - np.median(change)) > config.motion_colour
    return np.asarray(moved)


def _nan_mean(depths: Sequence[DepthImage]) -> DepthImage:
    stack = np.stack(depths)
    known = np.isfinite(stack)
    count = known.sum(axis=0)
    total = np.where(known, stack, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def _check(colours: Sequence[ColourImage], depths: Sequence[DepthImage]) -> None:
    if not depths or len(colours) != len(depths):
        raise InvalidInputError(
            "as many colour as depth images are wanted, at least one, got "
            f"{len(colours)} and {len(depths)}"
        )
    shapes = {depth.shape for depth in depths} | {colour.shape[:2] for colour in colours}
    if len(shapes) != 1:
        raise InvalidInputError(
            f"all images must have the same size, got {sorted(shapes)}; use one camera mode"
        )
