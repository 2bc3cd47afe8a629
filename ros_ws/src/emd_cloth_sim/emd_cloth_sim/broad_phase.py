"""What is near what: boxes around patches of the mesh, compared sixteen at a time.

The cloth is cut into patches of `SIDE` x `SIDE` vertices. A vertex owns the cell above it, so each
place of a patch stands for a vertex and a cell. Boxes of patches are compared first, then those of
their places. Unlike cells of a grid in space this needs no sorting, and layers that lie on each
other do not slow it down.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST

SIDE = 4
PLACES = SIDE * SIDE
FAR = np.float32(1e9)
BIT_OF_REMAINDER = np.zeros(37, dtype=np.int64)
BIT_OF_REMAINDER[[pow(2, bit, 37) for bit in range(36)]] = range(36)


Boxes = NDArray[np.float32]


class Patches(NamedTuple):
    """The cloth's patches; memory of the searches.

    Boxes come in blocks of `PLACES`: all their low x, then all high x, low y, high y, low z and
    high z, in metres. A box around nothing ends before it begins.

    Attributes:
        places: Vertex of each place of each patch, shape (N * PLACES,); -1 beyond the hem.
        cells: Number of its cell; -1 at the far hems.
        rows: Its count along x, and `columns` along y.
        boxes: Of the cells, a block for each patch, shape (N * 6 * PLACES,).
        patch_boxes: Around the cells of each patch, shape (6 * N,), N rounded up to blocks.
        pairs: Pairs of patches whose boxes overlap, shape (M, 2).
    """

    places: IndexArray
    cells: IndexArray
    rows: IndexArray
    columns: IndexArray
    boxes: Boxes
    patch_boxes: Boxes
    pairs: IndexArray


class Candidates(NamedTuple):
    """Pairs that may touch before the next search, all of shape (M,).

    Attributes:
        vertex: Vertex of a pair.
        triangle: Its triangle.
        side: Side of the triangle on which the vertex is, 1 or -1.
        wake: The pair sleeps until the cloth has travelled this far since the search, metres;
            -1 for a pair in contact.
        awake: Pairs that may wake soon; only as many as are noted.
    """

    vertex: IndexArray
    triangle: IndexArray
    side: NDArray[np.float32]
    wake: NDArray[np.float32]
    awake: IndexArray


def allocate_candidates(size: int) -> Candidates:
    """Make lists for `size` pairs."""
    return Candidates(
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.int32),
    )


def make_patches(vertices: tuple[int, int]) -> Patches:
    """Cut a mesh into patches."""
    rows, columns = vertices
    tall, wide = -(-rows // SIDE), -(-columns // SIDE)
    index = np.full((tall * SIDE, wide * SIDE), -1, dtype=np.int32)
    index[:rows, :columns] = np.arange(rows * columns, dtype=np.int32).reshape(vertices)
    cells = np.full_like(index, -1)
    cells[: rows - 1, : columns - 1] = np.arange((rows - 1) * (columns - 1)).reshape(
        rows - 1, columns - 1
    )
    row, column = np.indices(index.shape, dtype=np.int32)
    places, cells, row, column = (
        np.ascontiguousarray(values.reshape(tall, SIDE, wide, SIDE).swapaxes(1, 2).reshape(-1))
        for values in (index, cells, row, column)
    )
    count = tall * wide
    return Patches(
        places,
        cells,
        row,
        column,
        np.empty(count * 6 * PLACES, dtype=np.float32),
        np.empty(-(-count // PLACES) * 6 * PLACES, dtype=np.float32),
        np.empty((count * (count + 1) // 2, 2), dtype=np.int32),
    )


@njit(**FAST)
def fill_boxes(
    position: NDArray[np.float32], rows: int, columns: int, pad: np.float32, patches: Patches
) -> None:
    """Put boxes grown by `pad` around the cells and patches; a cell at the hem is what it has."""
    places, boxes, patch_boxes = patches.places, patches.boxes, patches.patch_boxes
    for n in range(patch_boxes.shape[0]):
        patch_boxes[n] = FAR if n // PLACES % 2 == 0 else -FAR
    for n in range(places.shape[0]):
        v = max(places[n], 0)
        right = v + columns if patches.rows[n] + 1 < rows else v
        up = 1 if patches.columns[n] + 1 < columns else 0
        at = n // PLACES * 6 * PLACES + n % PLACES
        p = n // PLACES
        around = p // PLACES * 6 * PLACES + p % PLACES
        for k in range(3):
            low, high = FAR, -FAR
            if places[n] >= 0:
                a, b = position[v, k], position[v + up, k]
                c, d = position[right, k], position[right + up, k]
                low = min(min(a, b), min(c, d)) - pad
                high = max(max(a, b), max(c, d)) + pad
            boxes[at + 2 * k * PLACES] = low
            boxes[at + (2 * k + 1) * PLACES] = high
            lowest, highest = around + 2 * k * PLACES, around + (2 * k + 1) * PLACES
            patch_boxes[lowest] = min(patch_boxes[lowest], low)
            patch_boxes[highest] = max(patch_boxes[highest], high)


@njit(**FAST)
def pair_patches(patches: Patches) -> int:
    """List the pairs of patches, first no later than second, whose boxes overlap."""
    boxes, pairs = patches.patch_boxes, patches.pairs
    found = 0
    for p in range(patches.places.shape[0] // PLACES):
        x0, x1, y0, y1, z0, z1 = box_of(boxes, p)
        for block in range(p // PLACES, boxes.shape[0] // (6 * PLACES)):
            marks = mark_overlaps(boxes, block, x0, x1, y0, y1, z0, z1)
            while marks != 0:
                q = block * PLACES + lowest_bit(marks)
                marks &= marks - 1
                if q >= p:
                    pairs[found, 0] = p
                    pairs[found, 1] = q
                    found += 1
    return found


@njit(inline="always")
def box_of(
    boxes: Boxes, n: int
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Low x, high x, low y, high y, low z, high z of box n; boxes come in blocks of `PLACES`."""
    at = n // PLACES * 6 * PLACES + n % PLACES
    return (
        boxes[at],
        boxes[at + PLACES],
        boxes[at + 2 * PLACES],
        boxes[at + 3 * PLACES],
        boxes[at + 4 * PLACES],
        boxes[at + 5 * PLACES],
    )


@njit(inline="always")
def mark_overlaps(
    boxes: Boxes,
    block: int,
    x0: np.float32,
    x1: np.float32,
    y0: np.float32,
    y1: np.float32,
    z0: np.float32,
    z1: np.float32,
) -> int:
    """Which boxes of a block meet the given one, as bits."""
    # A view of the block alone spares the compiler doubts about the signs of its indices.
    near = boxes[6 * block * PLACES : 6 * (block + 1) * PLACES]
    marks = 0
    for s in range(PLACES):
        hit = (
            (near[s] <= x1)
            & (near[PLACES + s] >= x0)
            & (near[2 * PLACES + s] <= y1)
            & (near[3 * PLACES + s] >= y0)
            & (near[4 * PLACES + s] <= z1)
            & (near[5 * PLACES + s] >= z0)
        )
        marks += hit << s
    return marks


@njit(inline="always")
def lowest_bit(marks: int) -> int:
    """Place of the lowest bit of a number that is not zero."""
    # The powers of two below 2^36 leave different remainders by 37.
    return BIT_OF_REMAINDER[(marks & -marks) % 37]
