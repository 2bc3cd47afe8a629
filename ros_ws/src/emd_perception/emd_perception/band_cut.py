"""GraphCut in a narrow band along a known outline (banded graph cuts, Lombaert et al. 2005).

Pixels outside the band keep their side, so they need no nodes: their edges into the band become
links of the band's pixels with source and sink.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_perception.colour_mixtures import ColourMixtures
from emd_perception.image_types import Mask
from emd_perception.mask_morphology import dilate, erode
from emd_perception.minimum_cut import source_side

_GAMMA = 50.0  # weight of the outline's length (Rother et al. 2004)
_CAPACITY_UNIT = 0.02  # capacities are whole numbers
_MAX_LOG_ODDS = 450.0  # as much as all edges of a pixel together
_NEGLIGIBLE = 20.0  # differences of colour with beta d^2 above this weigh nothing
_TABLE_SIZE = 4096  # weights; neighbouring ones differ by half a percent at most
_NO_NODE = -1  # the pixel keeps its side, or lies beyond the picture

# Row and column steps to the eight neighbours; the way back from the k-th is the (7 - k)-th.
_STEPS = np.array([(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)])


def band_along(outline_of: Mask, reach: int) -> Mask:
    """Pixels within `reach` pixels of a mask's outline, on both sides."""
    side = 2 * reach + 1
    return dilate(outline_of, side) & ~erode(outline_of, side, outside=True)


def cut_band(
    picture: NDArray[np.uint8], inside: Mask, band: Mask, mixtures: ColourMixtures
) -> Mask:
    """Cut anew within a band, and keep the mask beside it.

    Energy: negative log-likelihood of each pixel's colour, and for each pair of the eight
    neighbours that is cut gamma exp(-beta d^2) / distance, d their difference of colour
    (Rother, Kolmogorov and Blake 2004, equations 9 to 11).

    Args:
        picture: Shape (H, W, 3), the channels of the mixtures.
        inside: The known mask, shape (H, W).
        band: Pixels that may change sides, shape (H, W).
        mixtures: Colours of both sides.

    Returns:
        Shape (H, W).
    """
    inside = np.ascontiguousarray(inside)
    refined = inside.copy()
    pixels = np.flatnonzero(band)
    if len(pixels) == 0:
        return refined
    nodes = np.full(band.shape, _NO_NODE, dtype=np.int32)
    nodes.ravel()[pixels] = np.arange(len(pixels), dtype=np.int32)
    neighbours, capacities, pull = _links(picture, inside, nodes, pixels)
    odds = mixtures.log_odds(picture.reshape(-1, 3)[pixels])
    preference = np.clip(odds, -_MAX_LOG_ODDS, _MAX_LOG_ODDS) + pull
    whole = np.rint(preference / _CAPACITY_UNIT).astype(np.int32)
    refined.ravel()[pixels] = source_side(neighbours, capacities, whole)
    return refined


def _links(
    picture: NDArray[np.uint8], inside: Mask, nodes: NDArray[np.int32], pixels: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Link the band's pixels with each other and with the pixels beside the band.

    Args:
        picture: Shape (H, W, 3).
        inside: Which side the pixels beside the band keep, shape (H, W).
        nodes: Number of each pixel of the band, -1 beside it, shape (H, W).
        pixels: Flat index of each node's pixel, shape (N,).

    Returns:
        Neighbours and capacities for `source_side`, shape (N, 8) each; and how much the pixels
        beside the band pull each node to the cloth, shape (N,).
    """
    squares = np.empty((len(pixels), 8), dtype=np.int32)
    total = _squared_differences(np.ascontiguousarray(picture), pixels, _STEPS, squares)
    mean = max(total / squares.size, 1e-6)
    # Differences of 8-bit colours are whole numbers, so their weights come from a table.
    step = int(2.0 * mean * _NEGLIGIBLE) // _TABLE_SIZE + 1
    known = np.arange(min(3 * 255**2, int(2.0 * mean * _NEGLIGIBLE)) // step + 1) * step
    straight = _GAMMA * np.exp(-(known + step // 2) / (2.0 * mean))
    weights = np.stack([straight, straight / np.sqrt(2.0)]).astype(np.float32)
    neighbours = np.empty((len(pixels), 8), dtype=np.int32)
    capacities = np.zeros((len(pixels), 8), dtype=np.int32)
    pull = np.zeros(len(pixels), dtype=np.float32)
    whole = np.rint(weights / _CAPACITY_UNIT).astype(np.int32)
    _fill_links(
        squares, step, inside, nodes, pixels, _STEPS, weights, whole, neighbours, capacities, pull
    )
    return neighbours, capacities, pull


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _squared_differences(
    picture: NDArray[np.uint8],
    pixels: NDArray[np.int64],
    steps: NDArray[np.int64],
    squares: NDArray[np.int32],
) -> float:
    """Square the differences of pixels' colours from their neighbours', and add them up.

    Beyond the picture's border its colours go on.
    """
    height, width = picture.shape[:2]
    total = np.int64(0)
    for node in range(len(pixels)):
        row, column = pixels[node] // width, pixels[node] % width
        for way in range(8):
            other_row = min(max(row + steps[way, 0], 0), height - 1)
            other_column = min(max(column + steps[way, 1], 0), width - 1)
            squared = np.int32(0)
            for channel in range(3):
                here = np.int32(picture[row, column, channel])
                difference = here - np.int32(picture[other_row, other_column, channel])
                squared += difference * difference
            squares[node, way] = squared
            total += squared
    return float(total)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_links(
    squares: NDArray[np.int32],
    step: int,
    inside: Mask,
    nodes: NDArray[np.int32],
    pixels: NDArray[np.int64],
    steps: NDArray[np.int64],
    weights: NDArray[np.float32],
    whole: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    capacities: NDArray[np.int32],
    pull: NDArray[np.float32],
) -> None:
    """Fill what `_links` returns; weights, straight and diagonal, by squared difference / step."""
    height, width = inside.shape
    for node in range(len(pixels)):
        row, column = pixels[node] // width, pixels[node] % width
        for way in range(8):
            other_row, other_column = row + steps[way, 0], column + steps[way, 1]
            neighbours[node, way] = _NO_NODE
            if not (0 <= other_row < height and 0 <= other_column < width):
                continue
            other = nodes[other_row, other_column]
            neighbours[node, way] = other
            index = squares[node, way] // step
            if index >= weights.shape[1]:
                continue
            diagonal = 1 if steps[way, 0] != 0 and steps[way, 1] != 0 else 0
            if other >= 0:
                capacities[node, way] = whole[diagonal, index]
            elif inside[other_row, other_column]:
                pull[node] += weights[diagonal, index]
            else:
                pull[node] -= weights[diagonal, index]
