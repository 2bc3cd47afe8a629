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
from emd_cloth_sim.planes import FAST, Single

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
        normals: Of the triangles, as long as twice their areas, shape (T, 3).
        cones: Box around the normals of each patch: low x, high x, low y ..., shape (N, 6).
    """

    places: IndexArray
    cells: IndexArray
    rows: IndexArray
    columns: IndexArray
    boxes: Boxes
    patch_boxes: Boxes
    pairs: IndexArray
    normals: NDArray[np.float32]
    cones: NDArray[np.float32]


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
        np.empty((2 * (rows - 1) * (columns - 1), 3), dtype=np.float32),
        np.empty((count, 6), dtype=np.float32),
    )


@njit(**FAST)
def fill_boxes(
    position: NDArray[np.float32], rows: int, columns: int, pad: Single, patches: Patches
) -> None:
    """Put boxes grown by `pad` around all cells and patches."""
    patch_boxes = patches.patch_boxes
    for n in range(patch_boxes.shape[0]):
        patch_boxes[n] = FAR if n // PLACES % 2 == 0 else -FAR
    for p in range(patches.places.shape[0] // PLACES):
        fill_patch(position, rows, columns, pad, patches, p)


@njit(**FAST)
def fill_patch(
    position: NDArray[np.float32],
    rows: int,
    columns: int,
    pad: Single,
    patches: Patches,
    p: int,
) -> None:
    """Put boxes grown by `pad` around a patch and its cells; a cell at the hem is what it has."""
    places, boxes, patch_boxes = patches.places, patches.boxes, patches.patch_boxes
    around = p // PLACES * 6 * PLACES + p % PLACES
    for k in range(3):
        patch_low, patch_high = FAR, -FAR
        for s in range(PLACES):
            n = p * PLACES + s
            low, high = FAR, -FAR
            if places[n] >= 0:
                v = places[n]
                right = v + columns if patches.rows[n] + 1 < rows else v
                up = 1 if patches.columns[n] + 1 < columns else 0
                a, b = position[v, k], position[v + up, k]
                c, d = position[right, k], position[right + up, k]
                low = min(min(a, b), min(c, d)) - pad
                high = max(max(a, b), max(c, d)) + pad
            boxes[(6 * p + 2 * k) * PLACES + s] = low
            boxes[(6 * p + 2 * k + 1) * PLACES + s] = high
            patch_low, patch_high = min(patch_low, low), max(patch_high, high)
        patch_boxes[around + 2 * k * PLACES] = patch_low
        patch_boxes[around + (2 * k + 1) * PLACES] = patch_high


@njit(**FAST)
def fill_normals(position: NDArray[np.float32], triangles: IndexArray, patches: Patches) -> None:
    """Work out the triangles' normals and the boxes around those of each patch."""
    normals, cones = patches.normals, patches.cones
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        u0, u1, u2 = (
            position[b, 0] - position[a, 0],
            position[b, 1] - position[a, 1],
            position[b, 2] - position[a, 2],
        )
        v0, v1, v2 = (
            position[c, 0] - position[a, 0],
            position[c, 1] - position[a, 1],
            position[c, 2] - position[a, 2],
        )
        normals[t, 0] = u1 * v2 - u2 * v1
        normals[t, 1] = u2 * v0 - u0 * v2
        normals[t, 2] = u0 * v1 - u1 * v0
    for p in range(cones.shape[0]):
        for k in range(3):
            low, high = FAR, -FAR
            for n in range(p * PLACES, (p + 1) * PLACES):
                cell = patches.cells[n]
                if cell >= 0:
                    one, other = normals[2 * cell, k], normals[2 * cell + 1, k]
                    low = min(low, min(one, other))
                    high = max(high, max(one, other))
            cones[p, 2 * k] = low
            cones[p, 2 * k + 1] = high


@njit(inline="always")
def _smooth(patches: Patches, p: int, q: int, facing: Single) -> bool:
    """Whether two patches are neighbours that face the same way, so that they cannot meet.

    The cosines of all their normals with one direction must be above `facing` (Volino and
    Magnenat-Thalmann, "Efficient Self-Collision Detection on Smoothly Discretized Surface
    Animations", 1994).
    """
    rows = patches.rows[p * PLACES] - patches.rows[q * PLACES]
    columns = patches.columns[p * PLACES] - patches.columns[q * PLACES]
    if abs(rows) > SIDE or abs(columns) > SIDE:
        return False
    cones = patches.cones
    one = other = square = np.float32(0.0)
    for k in range(3):
        middle = cones[p, 2 * k] + cones[p, 2 * k + 1] + cones[q, 2 * k] + cones[q, 2 * k + 1]
        square += middle * middle
        one += min(cones[p, 2 * k] * middle, cones[p, 2 * k + 1] * middle)
        other += min(cones[q, 2 * k] * middle, cones[q, 2 * k + 1] * middle)
    # `middle` is about four normals long.
    least = np.float32(0.25) * facing * square
    return one > least and other > least


@njit(**FAST)
def pair_patches(patches: Patches, facing: Single, gap: Single) -> int:
    """List the pairs of patches, first no later than second, that may touch.

    Their boxes are less than `gap` (metres) apart, and they are not neighbours all of whose
    normals are within one cone, the cosine of whose half angle is `facing` (above 1: none are).
    """
    boxes, pairs = patches.patch_boxes, patches.pairs
    found = 0
    for p in range(patches.places.shape[0] // PLACES):
        x0, x1, y0, y1, z0, z1 = box_of(boxes, p)
        x0, x1, y0, y1, z0, z1 = x0 - gap, x1 + gap, y0 - gap, y1 + gap, z0 - gap, z1 + gap
        for block in range(p // PLACES, boxes.shape[0] // (6 * PLACES)):
            marks = mark_overlaps(boxes, block, x0, x1, y0, y1, z0, z1)
            while marks != 0:
                q = block * PLACES + lowest_bit(marks)
                marks &= marks - 1
                if q >= p and not _smooth(patches, p, q, facing):
                    pairs[found, 0] = p
                    pairs[found, 1] = q
                    found += 1
    return found


@njit(inline="always")
def box_of(boxes: Boxes, n: int) -> tuple[Single, Single, Single, Single, Single, Single]:
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
def gap_between(boxes: Boxes, p: int, q: int) -> Single:
    """Lower bound of the distance between what is in two boxes, negative if they overlap."""
    px0, px1, py0, py1, pz0, pz1 = box_of(boxes, p)
    qx0, qx1, qy0, qy1, qz0, qz1 = box_of(boxes, q)
    x, y, z = max(px0 - qx1, qx0 - px1), max(py0 - qy1, qy0 - py1), max(pz0 - qz1, qz0 - pz1)
    return max(x, max(y, z))


@njit(inline="always")
def mark_overlaps(
    boxes: Boxes,
    block: int,
    x0: Single,
    x1: Single,
    y0: Single,
    y1: Single,
    z0: Single,
    z1: Single,
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
