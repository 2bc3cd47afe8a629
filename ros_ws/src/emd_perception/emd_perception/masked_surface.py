"""Points of the pixels of a mask, in the table frame; pixels without a depth take one nearby."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, Mask
from emd_perception.mask_morphology import bounding_window
from emd_perception.unprojection import ray_parts

_NO_ROW = -1


@dataclass(frozen=True)
class MaskedSurface:
    """What the depth image tells of a mask.

    Attributes:
        footprint_in_table: x and y of every pixel of the mask, shape (P, 2), metres. Pixels
            without a depth take the height of the nearest pixel that has one, so that no part
            vanishes.
        known_points_in_table: Points of the pixels that have a depth, shape (K, 3), metres.
        known_colours: Colours of the same, shape (K, 3), RGB uint8.
    """

    footprint_in_table: FloatArray
    known_points_in_table: FloatArray
    known_colours: NDArray[np.uint8]

    @property
    def known_share(self) -> float:
        """Share of the mask's pixels that have a depth, 0..1; 0 for an empty mask."""
        return len(self.known_points_in_table) / max(len(self.footprint_in_table), 1)


def masked_surface(
    colour: ColourImage,
    depth: DepthImage,
    mask: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    max_spike: float,
) -> MaskedSurface:
    """Unproject the pixels of a mask.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        depth: Shape (H, W), metres, NaN where unknown.
        mask: Shape (H, W).
        camera: The camera of both images.
        transform_camera_to_table: Shape (4, 4), metres.
        max_spike: Depths farther than this from the median of the 5 x 5 around them count as
            unknown, metres.

    Returns:
        The surface; without any known depth it is empty, the footprint too.
    """
    window = bounding_window(mask, 2)
    colour, depth, mask = colour[window].copy(), depth[window].copy(), mask[window].copy()
    known = _known(depth, mask, np.float32(max_spike))
    count, known_count = (int(np.count_nonzero(one)) for one in (mask, known))
    if known_count == 0:
        count = 0
    footprint = np.empty((2, count))
    points, colours = np.empty((known_count, 3)), np.empty((known_count, 3), dtype=np.uint8)
    if count > 0:
        of_column, of_row = ray_parts(transform_camera_to_table[:3, :3], camera)
        rays = (
            np.ascontiguousarray(of_column[:, window[1]]),
            np.ascontiguousarray(of_row[:, window[0]]),
        )
        origin = transform_camera_to_table[:3, 3].astype(np.float64)
        _unproject(colour, depth, mask, known, *rays, origin, footprint, points, colours)
    return MaskedSurface(footprint.T, points, colours)


def _known(depth: DepthImage, mask: Mask, max_spike: np.float32) -> Mask:
    """Pixels of the mask with a depth that is no spike; unknown neighbours count as near."""
    middle = np.asarray(cv2.medianBlur(cv2.patchNaNs(depth.copy(), 0.0), 5), dtype=np.float32)
    known = np.empty(mask.shape, dtype=np.bool_)
    _leave_out_spikes(depth, mask, middle, max_spike, known)
    return known


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _leave_out_spikes(
    depth: DepthImage, mask: Mask, middle: DepthImage, max_spike: np.float32, known: Mask
) -> None:
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            beside = middle[row, column]
            here = depth[row, column]
            spike = beside > 0 and abs(here - beside) > max_spike
            known[row, column] = mask[row, column] and np.isfinite(here) and not spike


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _nearest_rows(known: Mask, nearest: NDArray[np.int32]) -> None:
    """Give the row of the nearest known pixel in each pixel's column, -1 where there is none."""
    height, width = known.shape
    for row in range(height):
        for column in range(width):
            if known[row, column]:
                nearest[row, column] = row
            else:
                nearest[row, column] = nearest[row - 1, column] if row > 0 else _NO_ROW
    for row in range(height - 2, -1, -1):
        for column in range(width):
            above, below = nearest[row, column], nearest[row + 1, column]
            if below >= 0 and (above < 0 or below - row < row - above):
                nearest[row, column] = below


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _nearest_known(row: int, column: int, nearest: NDArray[np.int32]) -> tuple[int, int]:
    """Give row and column of the known pixel nearest to a pixel."""
    width = nearest.shape[1]
    best, best_row, best_column = np.int64(1) << 60, row, column
    for aside in range(width):
        if aside * aside >= best:
            break
        for side in (-aside, aside):
            other = column + side
            if 0 <= other < width and nearest[row, other] >= 0:
                down = nearest[row, other] - row
                squared = aside * aside + down * down
                if squared < best:
                    best, best_row, best_column = squared, nearest[row, other], other
    return best_row, best_column


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _unproject(
    colour: ColourImage,
    depth: DepthImage,
    mask: Mask,
    known: Mask,
    of_column: FloatImage,
    of_row: FloatImage,
    origin: FloatArray,
    footprint: FloatArray,
    points: FloatArray,
    colours: NDArray[np.uint8],
) -> None:
    """Fill footprint, points and colours row by row; at least one pixel is known."""
    nearest = np.empty(mask.shape if len(points) < footprint.shape[1] else (1, 1), dtype=np.int32)
    if nearest.size == mask.size:
        _nearest_rows(known, nearest)
    pixel = point = 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if not mask[row, column]:
                continue
            fall = of_column[2, column] + of_row[2, row]  # height per metre of depth
            reach = np.float64(depth[row, column])
            if not known[row, column]:
                i, j = _nearest_known(row, column, nearest)
                reach = (of_column[2, j] + of_row[2, i]) * np.float64(depth[i, j]) / fall
            for axis in range(2):
                ray = of_column[axis, column] + of_row[axis, row]
                footprint[axis, pixel] = ray * reach + origin[axis]
            if known[row, column]:
                points[point, 0], points[point, 1] = footprint[0, pixel], footprint[1, pixel]
                points[point, 2] = fall * reach + origin[2]
                colours[point] = colour[row, column]
                point += 1
            pixel += 1
