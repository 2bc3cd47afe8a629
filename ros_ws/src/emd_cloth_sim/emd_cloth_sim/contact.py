"""Contact of the cloth with itself and with the desk, with Coulomb friction.

Self-contact keeps every vertex one thickness away from every triangle that is not its neighbour
(Bridson et al., "Robust Treatment of Collisions, Contact and Friction for Cloth Animation", 2002,
the vertex-triangle half). So the thickness is free of the mesh spacing. Three lists keep it cheap:
the candidates, searched when the cloth has moved by a margin; of these the pairs that may touch
within the next few substeps, with their normals and weights; and of these those that do.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.closest_points import closest_on_triangle, height_over_triangle
from emd_cloth_sim.contact_pairs import Candidates, Contacts, Segments
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, Single

Positions = NDArray[np.floating[Any]]
ZERO, ONE = np.float32(0.0), np.float32(1.0)
IN_CONTACT = np.float32(-1.0)
LONG = np.float32(1.0)
TINY = np.float32(1e-9)


@njit(inline="always")
def _gap(
    position: Positions,
    v: int,
    a: int,
    b: int,
    c: int,
    wa: Single,
    wb: Single,
    wc: Single,
    k: int,
) -> Single:
    """From the triangle's point to the vertex, along axis k."""
    return position[v, k] - wa * position[a, k] - wb * position[b, k] - wc * position[c, k]


@njit(**FAST)
def find_contacts(
    position: Positions,
    triangles: IndexArray,
    owners: NDArray[np.uint8],
    candidates: Candidates,
    segments: Segments,
    m: int,
    so_far: Single,
    horizon: Single,
    thickness: Single,
    contacts: Contacts,
) -> None:
    """List those candidates of pair m of patches that may touch before these move the `horizon`.

    The patches have moved `so_far`. A pair in contact (its wake is -1) remembers on which side of
    the triangle its vertex was, so that a vertex that came through is pushed back; beside the
    triangle it may change sides. A corner or side is met once, as part of the triangle that owns
    it.
    """
    found = segments.start[m]
    vertex, triangle, side, wake = candidates
    first_wake = so_far + LONG
    for n in range(segments.start[m], segments.stop[m]):
        if so_far + horizon < wake[n]:
            first_wake = min(first_wake, wake[n])
            continue
        v, t = vertex[n], triangle[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        height = height_over_triangle(position, v, a, b, c)
        if wake[n] >= ZERO:
            # It slept, so it has not touched since: whatever side it is on now is right.
            side[n] = ONE if height >= ZERO else -ONE
        height *= side[n]
        gap = height
        if height < thickness + horizon:
            wa, wb, wc = closest_on_triangle(
                position[v, 0], position[v, 1], position[v, 2], position, a, b, c
            )
            x = _gap(position, v, a, b, c, wa, wb, wc, 0)
            y = _gap(position, v, a, b, c, wa, wb, wc, 1)
            z = _gap(position, v, a, b, c, wa, wb, wc, 2)
            distance = math.sqrt(x * x + y * y + z * z)
            sign = ONE if height > ZERO else -ONE
            if not (wa > ZERO and wb > ZERO and wc > ZERO):
                gap, sign = distance, ONE
                if height < ZERO:
                    side[n] = -side[n]
            part = (wa > ZERO) + 2 * (wb > ZERO) + 4 * (wc > ZERO)
            owned = (owners[t] >> part) & 1 == 1
            if owned and gap < thickness + horizon and distance > TINY:
                sign /= distance
                corners, weights, normal = contacts
                corners[found, 0], corners[found, 1] = v, a
                corners[found, 2], corners[found, 3] = b, c
                weights[found, 0], weights[found, 1], weights[found, 2] = wa, wb, wc
                normal[found, 0] = x * sign
                normal[found, 1] = y * sign
                normal[found, 2] = z * sign
                found += 1
        wake[n] = so_far + gap - thickness if gap >= thickness else IN_CONTACT
        first_wake = min(first_wake, wake[n])
    segments.wake[m] = first_wake
    segments.touching[m] = found - segments.start[m]
    segments.good[m] = so_far + horizon


@njit(**FAST)
def collide_with_self(
    position: Positions,
    previous: Positions,
    contacts: Contacts,
    segments: Segments,
    pairs: int,
    thickness: Single,
    friction: Single,
    separation: Single,
) -> None:
    """Push vertices and triangles that are closer than `thickness` apart, with friction.

    They are the contacts of the first `pairs` pairs of patches.
    """
    corners, weights, normal = contacts
    for m in range(pairs):
        for n in range(segments.start[m], segments.start[m] + segments.touching[m]):
            v, a, b, c = corners[n, 0], corners[n, 1], corners[n, 2], corners[n, 3]
            wa, wb, wc = weights[n, 0], weights[n, 1], weights[n, 2]
            nx, ny, nz = normal[n, 0], normal[n, 1], normal[n, 2]
            gap = (
                nx * _gap(position, v, a, b, c, wa, wb, wc, 0)
                + ny * _gap(position, v, a, b, c, wa, wb, wc, 1)
                + nz * _gap(position, v, a, b, c, wa, wb, wc, 2)
            )
            if gap < thickness:
                _push_apart(
                    position,
                    previous,
                    (v, a, b, c),
                    (wa, wb, wc),
                    (nx, ny, nz),
                    min(thickness - gap, thickness),
                    friction,
                    separation,
                )


@njit(inline="always")
def _push_apart(
    position: Positions,
    previous: Positions,
    corners: tuple[int, int, int, int],
    weights: tuple[Single, Single, Single],
    normal: tuple[Single, Single, Single],
    depth: Single,
    friction: Single,
    separation: Single,
) -> None:
    """Move a vertex and a triangle of equal masses apart by `depth`, and brake their sliding.

    They part by no more than `separation` (metres in a substep).
    """
    v, a, b, c = corners
    wa, wb, wc = weights
    nx, ny, nz = normal
    share = ONE / (ONE + wa * wa + wb * wb + wc * wc)
    sx = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 0)
    sy = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 1)
    sz = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 2)
    along = sx * nx + sy * ny + sz * nz
    depth = min(depth, max(separation - along, ZERO))
    sx -= along * nx
    sy -= along * ny
    sz -= along * nz
    slide = math.sqrt(sx * sx + sy * sy + sz * sz)
    brake = ONE
    if slide > friction * depth:
        brake = friction * depth / slide
    mx = share * (depth * nx - brake * sx)
    my = share * (depth * ny - brake * sy)
    mz = share * (depth * nz - brake * sz)
    position[v, 0] += mx
    position[v, 1] += my
    position[v, 2] += mz
    position[a, 0] -= wa * mx
    position[a, 1] -= wa * my
    position[a, 2] -= wa * mz
    position[b, 0] -= wb * mx
    position[b, 1] -= wb * my
    position[b, 2] -= wb * mz
    position[c, 0] -= wc * mx
    position[c, 1] -= wc * my
    position[c, 2] -= wc * mz


@njit(inline="always")
def _relative_way(
    position: Positions,
    previous: Positions,
    v: int,
    a: int,
    b: int,
    c: int,
    wa: Single,
    wb: Single,
    wc: Single,
    k: int,
) -> Single:
    """Way of vertex v in this substep against the triangle's point below it, along axis k."""
    return (
        position[v, k]
        - previous[v, k]
        - wa * (position[a, k] - previous[a, k])
        - wb * (position[b, k] - previous[b, k])
        - wc * (position[c, k] - previous[c, k])
    )


@njit(**FAST)
def collide_with_desk(
    position: Positions,
    previous: Positions,
    height: Single,
    friction: float,
    separation: Single,
) -> None:
    """Keep vertices at least `height` over the desk (z = 0) and brake their sliding on it.

    A vertex that is too low rises by no more than `separation` (metres in a substep).
    """
    for v in range(position.shape[0]):
        depth = height - position[v, 2]
        if depth <= ZERO:
            continue
        depth = min(depth, max(previous[v, 2] - position[v, 2] + separation, ZERO))
        position[v, 2] += depth
        x = position[v, 0] - previous[v, 0]
        y = position[v, 1] - previous[v, 1]
        slide = math.sqrt(x * x + y * y)
        brake = ONE
        if slide > friction * depth:
            brake = friction * depth / slide
        position[v, 0] -= brake * x
        position[v, 1] -= brake * y
