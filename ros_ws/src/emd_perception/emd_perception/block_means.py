"""Means over the blocks of pixels that make one reduced pixel."""

from __future__ import annotations

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from emd_perception.image_types import ColourImage, DepthImage, FloatImage


def reduce_colour(colour: ColourImage, shape: tuple[int, int]) -> ColourImage:
    """Average a colour image over blocks.

    OpenCV halves pictures three times as fast as it reduces them by other factors.

    Args:
        colour: Shape (H, W, 3), uint8.
        shape: Rows and columns wanted, (h, w); at most those of the image.

    Returns:
        Shape (h, w, 3), uint8.
    """
    rows, columns = colour.shape[:2]
    while rows % (2 * shape[0]) == columns % (2 * shape[1]) == 0:  # so that blocks stay whole
        rows, columns = rows // 2, columns // 2
        colour = _resized(colour, (rows, columns))
    return _resized(colour, shape)


def reduce_known(image: DepthImage, shape: tuple[int, int]) -> tuple[FloatImage, FloatImage]:
    """Add up what is known of an image in each block.

    Args:
        image: Shape (H, W), float32, NaN where unknown.
        shape: Rows and columns wanted, (h, w); at most those of the image.

    Returns:
        Sums of the known values and the count of known pixels, both a pixel of the block, shape
        (h, w) each.
    """
    total, known = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
    _add_known(np.ascontiguousarray(image), *_block_edges(image.shape, shape), total, known)
    return total, known


def _resized(colour: ColourImage, shape: tuple[int, int]) -> ColourImage:
    if colour.shape[:2] == shape:
        return colour
    reduced = cv2.resize(colour, shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, dtype=np.uint8)


def _block_edges(
    size: tuple[int, ...], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First row of each block and the end of the last, and the same of the columns."""
    rows, columns = (
        np.round(np.linspace(0, many, few + 1)).astype(np.int64)
        for many, few in zip(size, shape, strict=False)
    )
    return rows, columns


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_known(
    image: DepthImage,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    total: FloatImage,
    known: FloatImage,
) -> None:
    sums, counts = np.empty((2, image.shape[1]), dtype=np.float32)
    nothing, one = np.float32(0.0), np.float32(1.0)
    for block_row in range(len(rows) - 1):
        sums[:], counts[:] = nothing, nothing
        for row in range(rows[block_row], rows[block_row + 1]):
            line = image[row]
            for column in range(len(line)):
                is_known = line[column] == line[column]
                sums[column] += line[column] if is_known else nothing
                counts[column] += one if is_known else nothing
        height = rows[block_row + 1] - rows[block_row]
        for block in range(len(columns) - 1):
            start, end = columns[block], columns[block + 1]
            share = one / np.float32(height * (end - start))
            value, count = nothing, nothing
            for column in range(start, end):
                value += sums[column]
                count += counts[column]
            total[block_row, block], known[block_row, block] = value * share, count * share
