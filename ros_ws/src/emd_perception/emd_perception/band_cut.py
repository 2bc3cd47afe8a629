"""GraphCut in a narrow band along a known outline (banded graph cuts, Lombaert et al. 2005).

Pixels outside the band keep their side, so they need no nodes: their edges into the band become
links of the band's pixels with source and sink. The minimum cut is SciPy's (Dinic).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from emd_perception.colour_mixtures import ColourMixtures
from emd_perception.image_types import Mask
from emd_perception.mask_morphology import dilate, erode

_GAMMA = 50.0  # weight of the outline's length (Rother et al. 2004)
_CAPACITY_UNIT = 0.02  # SciPy's capacities are whole numbers
_MAX_LOG_ODDS = 450.0  # as much as all edges of a pixel together
_SURE = -1  # no node: the pixel keeps its side
_BEYOND = -2  # no node: not in the picture

# Row and column steps to the eight neighbours, in the order in which they are numbered.
_STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


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
    if not band.any():
        return inside.copy()
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    width = padded.shape[1]
    nodes = _number_nodes(band)
    pixels = np.flatnonzero(nodes.ravel() >= 0)
    neighbours = pixels[:, None] + np.array([v * width + u for v, u in _STEPS])
    weights = _edge_weights(padded.reshape(-1, 3), pixels, neighbours)
    nodes_beside = nodes.ravel()[neighbours]
    weights[nodes_beside == _BEYOND] = 0.0
    towards_cloth = np.where(np.pad(inside, 1).ravel()[neighbours], weights, -weights)
    preference = np.clip(mixtures.log_odds(picture[band]), -_MAX_LOG_ODDS, _MAX_LOG_ODDS)
    preference += np.where(nodes_beside == _SURE, towards_cloth, 0.0).sum(axis=1)
    refined = inside.copy()
    refined[band] = _source_side(nodes_beside, weights, preference)
    return refined


def _number_nodes(band: Mask) -> NDArray[np.int32]:
    """Number the band's pixels row by row; shape (H + 2, W + 2)."""
    nodes = np.full((band.shape[0] + 2, band.shape[1] + 2), _BEYOND, dtype=np.int32)
    inner = nodes[1:-1, 1:-1]
    inner[...] = _SURE
    inner[band] = np.arange(int(band.sum()), dtype=np.int32)
    return nodes


def _edge_weights(
    colours: NDArray[np.uint8], pixels: NDArray[np.int64], neighbours: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Weights of the edges to the eight neighbours, shape (N, 8)."""
    values = colours.astype(np.float32)
    difference = values[neighbours] - values[pixels][:, None]
    squared = np.einsum("nki,nki->nk", difference, difference)
    beta = 1.0 / (2.0 * max(float(squared.mean()), 1e-6))
    distance = np.array([np.hypot(*step) for step in _STEPS], dtype=np.float32)
    return np.asarray(np.float32(_GAMMA) * np.exp(np.float32(-beta) * squared) / distance)


def _source_side(
    neighbours: NDArray[np.int32], weights: NDArray[np.float32], preference: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Minimum cut of a graph of pixels.

    Args:
        neighbours: Nodes beside each node in rising order, negative where none is, shape (N, 8).
        weights: Of the edges to them, shape (N, 8).
        preference: Of each node, for the source where positive, for the sink where negative,
            shape (N,).

    Returns:
        Which nodes stay with the source, shape (N,).
    """
    count = len(preference)
    source, sink = count, count + 1
    links = np.rint(preference / _CAPACITY_UNIT).astype(np.int32)
    ends = np.column_stack([neighbours, np.full((count, 2), (source, sink), dtype=np.int32)])
    capacities = np.column_stack(
        [
            np.rint(weights / _CAPACITY_UNIT).astype(np.int32),
            np.zeros(count, np.int32),
            np.maximum(-links, 0),
        ]
    )
    # Each arc has its reverse, of capacity 0 if need be: rows of all nodes, of source and sink.
    present = ends >= 0
    all_nodes = np.arange(count, dtype=np.int32)
    columns = np.concatenate([ends[present], all_nodes, all_nodes])
    values = np.concatenate(
        [capacities[present], np.maximum(links, 0), np.zeros(count, dtype=np.int32)]
    )
    lengths = np.concatenate([[0], present.sum(axis=1), [count, count]])
    starts = np.cumsum(lengths).astype(np.int32)
    graph = csr_array((values, columns, starts), shape=(count + 2, count + 2))
    flow = maximum_flow(graph, source, sink).flow
    left = graph - flow
    left.eliminate_zeros()
    reached = breadth_first_order(left, source, return_predecessors=False)
    with_source = np.zeros(count + 2, dtype=bool)
    with_source[reached] = True
    return with_source[:count]
