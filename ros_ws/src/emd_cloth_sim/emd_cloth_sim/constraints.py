"""The constraints of the cloth: each kernel is one sweep over one kind, on planes (see `planes`).

All vertices have the same mass. A compliance is scaled by vertex mass over squared substep, so it
has no unit. Lengths and right angles are swept by Gauss-Seidel in colours that share no vertex;
bending, which is soft, all at once (Jacobi), which treats all directions alike.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, HALF, LANES, PITCH, ROW, Plane, Single

ONE, TWO = np.float32(1.0), np.float32(2.0)
ZERO, HALF_SHARE = np.float32(0.0), np.float32(0.5)
TINY = np.float32(1e-18)
# Greatest eigenvalue of one direction's bending constraints, so that a sweep never overshoots.
STIFFEST_BEND = np.float32(16.0)


@njit(**FAST)
def hold_lengths(
    planes: Plane,
    length_x: Plane,
    length_y: Plane,
    rows: int,
    columns: int,
    compliance: tuple[Single, Single],
) -> None:
    """Pull neighbours to their rest lengths, which are listed at the lower vertex of each pair.

    The compliances are those of the edges along x and along y.
    """
    factor = ONE / (TWO + compliance[0])
    even, odd = (columns + 1) // 2, columns // 2
    for colour in range(2):
        for q in range((rows - colour) // 2):
            i = 2 * q + colour
            row, at = i * ROW, i * PITCH
            _pull_run(planes, row, row + ROW, length_x, at, even, factor)
            _pull_run(planes, row + HALF, row + ROW + HALF, length_x, at + HALF, odd, factor)
    factor = ONE / (TWO + compliance[1])
    for i in range(rows):
        row, at = i * ROW, i * PITCH
        _pull_run(planes, row, row + HALF, length_y, at, odd, factor)
        _pull_run(planes, row + HALF, row + 1, length_y, at + HALF, even - 1, factor)


@njit(inline="always")
def _pull_run(
    planes: Plane, first: int, second: int, length: Plane, at: int, count: int, factor: Single
) -> None:
    """Pull `count` pairs that share no vertex."""
    for tile in range((count + LANES - 1) // LANES):
        for lane in range(LANES):
            m = tile * LANES + lane
            a, b = first + m, second + m
            x = planes[b] - planes[a]
            y = planes[b + PITCH] - planes[a + PITCH]
            z = planes[b + 2 * PITCH] - planes[a + 2 * PITCH]
            pull = factor * (ONE - length[at + m] / math.sqrt(x * x + y * y + z * z + TINY))
            pull = pull if m < count else ZERO
            planes[a] += pull * x
            planes[a + PITCH] += pull * y
            planes[a + 2 * PITCH] += pull * z
            planes[b] -= pull * x
            planes[b + PITCH] -= pull * y
            planes[b + 2 * PITCH] -= pull * z


@njit(**FAST)
def resist_shear(
    planes: Plane, rows: int, columns: int, length: Single, compliance: Single
) -> None:
    """Pull the legs of right-angled triangles to a right angle.

    The constraint is the legs' dot product over the `length` of a leg. Unlike springs along the
    diagonals it does not resist folding along them. The diagonals alternate as in `SheetMesh`.
    """
    inverse = ONE / length
    first, second = columns // 2, (columns - 1) // 2
    # Two triangles of each cell: of even rows and even columns, even and odd, odd and even, odd
    # and odd.
    for q in range(rows // 2):
        row = 2 * q * ROW
        _square_run(planes, row + ROW, row, row + ROW + HALF, first, inverse, compliance)
    for q in range(rows // 2):
        row = 2 * q * ROW
        _square_run(planes, row + HALF, row + ROW + HALF, row, first, inverse, compliance)
    for q in range(rows // 2):
        row = 2 * q * ROW
        _square_run(planes, row + HALF, row + ROW + HALF, row + 1, second, inverse, compliance)
    for q in range(rows // 2):
        row = 2 * q * ROW
        _square_run(planes, row + ROW + 1, row + 1, row + ROW + HALF, second, inverse, compliance)
    for q in range((rows - 1) // 2):
        row = (2 * q + 1) * ROW
        _square_run(planes, row, row + ROW, row + HALF, first, inverse, compliance)
    for q in range((rows - 1) // 2):
        row = (2 * q + 1) * ROW
        _square_run(planes, row + ROW + HALF, row + HALF, row + ROW, first, inverse, compliance)
    for q in range((rows - 1) // 2):
        row = (2 * q + 1) * ROW
        _square_run(
            planes, row + ROW + HALF, row + HALF, row + ROW + 1, second, inverse, compliance
        )
    for q in range((rows - 1) // 2):
        row = (2 * q + 1) * ROW
        _square_run(planes, row + 1, row + ROW + 1, row + HALF, second, inverse, compliance)


@njit(inline="always")
def _square_run(
    planes: Plane,
    corner: int,
    one: int,
    other: int,
    count: int,
    inverse: Single,
    compliance: Single,
) -> None:
    """Pull `count` angles that share no vertex, at `corner` with the legs to `one` and `other`."""
    for tile in range((count + LANES - 1) // LANES):
        for lane in range(LANES):
            m = tile * LANES + lane
            a, b, c = corner + m, one + m, other + m
            ux = (planes[b] - planes[a]) * inverse
            uy = (planes[b + PITCH] - planes[a + PITCH]) * inverse
            uz = (planes[b + 2 * PITCH] - planes[a + 2 * PITCH]) * inverse
            vx = (planes[c] - planes[a]) * inverse
            vy = (planes[c + PITCH] - planes[a + PITCH]) * inverse
            vz = (planes[c + 2 * PITCH] - planes[a + 2 * PITCH]) * inverse
            dot = ux * vx + uy * vy + uz * vz
            legs = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
            pull = -dot / (inverse * (TWO * (legs + dot) + compliance + TINY))
            pull = pull if m < count else ZERO
            planes[b] += pull * vx
            planes[b + PITCH] += pull * vy
            planes[b + 2 * PITCH] += pull * vz
            planes[c] += pull * ux
            planes[c + PITCH] += pull * uy
            planes[c + 2 * PITCH] += pull * uz
            planes[a] -= pull * (ux + vx)
            planes[a + PITCH] -= pull * (uy + vy)
            planes[a + 2 * PITCH] -= pull * (uz + vz)


@njit(**FAST)
def limit_sharpness(
    planes: Plane,
    rows: int,
    columns: int,
    shortest_x: Single,
    shortest_y: Single,
    shortest_diagonal: Single,
) -> None:
    """Keep vertices two edges or a diagonal apart at a distance, so that no fold is sharper."""
    even, odd = (columns + 1) // 2, columns // 2
    for i in range(rows):
        row = i * ROW
        if i + 2 < rows:
            _keep_apart(planes, row, row + 2 * ROW, even, shortest_x)
            _keep_apart(planes, row + HALF, row + 2 * ROW + HALF, odd, shortest_x)
        _keep_apart(planes, row, row + 1, even - 1, shortest_y)
        _keep_apart(planes, row + HALF, row + HALF + 1, odd - 1, shortest_y)
        if i + 1 < rows:
            _keep_apart(planes, row, row + ROW + HALF, odd, shortest_diagonal)
            _keep_apart(planes, row + HALF, row + ROW, odd, shortest_diagonal)
            _keep_apart(planes, row + HALF, row + ROW + 1, even - 1, shortest_diagonal)
            _keep_apart(planes, row + 1, row + ROW + HALF, even - 1, shortest_diagonal)


@njit(**FAST)
def _keep_apart(planes: Plane, first: int, second: int, count: int, shortest: Single) -> None:
    """Push `count` pairs in turn; most are far apart, so whole tiles of them are passed over."""
    limit = shortest * shortest
    for tile in range((count + LANES - 1) // LANES):
        start = tile * LANES
        one, other = planes[first + start :], planes[second + start :]
        near = 0
        for lane in range(min(LANES, count - start)):
            near += _square_gap(one, other, lane) < limit
        if near == 0:
            continue
        for lane in range(min(LANES, count - start)):
            square = _square_gap(one, other, lane)
            if square < limit:
                push = HALF_SHARE * (shortest / math.sqrt(square + TINY) - ONE)
                for k in range(0, ROW, PITCH):
                    way = push * (other[lane + k] - one[lane + k])
                    one[lane + k] -= way
                    other[lane + k] += way


@njit(inline="always")
def _square_gap(one: Plane, other: Plane, m: int) -> Single:
    x = other[m] - one[m]
    y = other[m + PITCH] - one[m + PITCH]
    z = other[m + 2 * PITCH] - one[m + 2 * PITCH]
    return x * x + y * y + z * z


@njit(**FAST)
def resist_bending(
    planes: Plane, bend: Plane, rows: int, columns: int, compliance: tuple[Single, Single]
) -> None:
    """Pull three vertices in a row towards a straight line (quadratic bending energy).

    `bend` is working memory as long as `planes`, zero where there is no vertex. The compliances
    are those of rows along x and along y.
    """
    factor = ONE / (STIFFEST_BEND + compliance[0])
    for i in range(rows - 2):
        for n in range(ROW):
            m = i * ROW + n
            bend[m] = factor * (planes[m] - TWO * planes[m + ROW] + planes[m + 2 * ROW])
    for i in range(rows - 2):
        for n in range(ROW):
            m = i * ROW + n
            planes[m] -= bend[m]
            planes[m + ROW] += TWO * bend[m]
            planes[m + 2 * ROW] -= bend[m]
    factor = ONE / (STIFFEST_BEND + compliance[1])
    for r in range(3 * rows):
        _bend_run(planes, bend, r * PITCH, columns, factor)


@njit(inline="always")
def _bend_run(planes: Plane, bend: Plane, run: int, columns: int, factor: Single) -> None:
    """Bending along j of one coordinate of one row, whose run begins at `run`."""
    # At even j, then at odd j; places without two neighbours are set to zero afterwards.
    for m in range(HALF - 1):
        n = run + m
        bend[n + 1] = factor * (planes[n + HALF] - TWO * planes[n + 1] + planes[n + HALF + 1])
    for m in range(HALF - 1):
        n = run + m
        bend[n + HALF] = factor * (planes[n] - TWO * planes[n + HALF] + planes[n + 1])
    bend[run] = ZERO
    for j in range(columns - 1, columns + 1):
        bend[run + (j & 1) * HALF + (j >> 1)] = ZERO
    for m in range(HALF - 1):
        n = run + m
        planes[n + HALF] -= bend[n] - TWO * bend[n + HALF] + bend[n + 1]
    planes[run] -= bend[run + HALF]
    for m in range(HALF - 1):
        n = run + m
        planes[n + 1] -= bend[n + HALF] - TWO * bend[n + 1] + bend[n + HALF + 1]


@njit(**FAST)
def pull_to_hands(
    position: NDArray[np.float32],
    held: IndexArray,
    start: NDArray[np.float32],
    end: NDArray[np.float32],
    progress: Single,
    reach: NDArray[np.float32],
) -> None:
    """Move held vertices to their place in the hand, as far as the grip's force allows.

    `position` is (V, 3). `reach` has a row for every held vertex: the longest move in all, and the
    longest downwards.
    """
    for c in range(held.shape[0]):
        v = held[c]
        x = start[c, 0] + progress * (end[c, 0] - start[c, 0]) - position[v, 0]
        y = start[c, 1] + progress * (end[c, 1] - start[c, 1]) - position[v, 1]
        z = start[c, 2] + progress * (end[c, 2] - start[c, 2]) - position[v, 2]
        z = max(z, -reach[c, 1])
        way = math.sqrt(x * x + y * y + z * z)
        scale = ONE
        if way > reach[c, 0]:
            scale = reach[c, 0] / way
        position[v, 0] += scale * x
        position[v, 1] += scale * y
        position[v, 2] += scale * z
