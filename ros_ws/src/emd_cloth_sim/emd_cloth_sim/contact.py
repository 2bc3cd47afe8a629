"""Contact of the cloth with itself and with the desk, with Coulomb friction.

Self-contact keeps every vertex one thickness away from every triangle it does not belong to
(Bridson et al., "Robust Treatment of Collisions, Contact and Friction for Cloth Animation", 2002,
the vertex-triangle half). So the thickness is free of the mesh spacing. Which pairs can touch is
searched only when the cloth has moved by a margin; between searches each pair sleeps until the
cloth could have moved far enough to close its gap.
"""

from __future__ import annotations

import math

from numba import njit

from emd_cloth_sim.broad_phase import Candidates
from emd_cloth_sim.closest_points import closest_on_triangle, height_over_triangle
from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray


@njit(cache=True)
def collide_with_self(
    position: FloatArray,
    previous: FloatArray,
    triangles: IndexArray,
    candidates: Candidates,
    count: int,
    travelled: float,
    thickness: float,
    friction: float,
    separation: float = math.inf,
) -> None:
    """Push vertices and triangles that are closer than `thickness` apart, with friction.

    A pair in contact (its wake is -1) remembers on which side of the triangle its vertex was, so
    that a vertex that came through is pushed back; beside the triangle it may change sides.
    """
    vertex, triangle, side, wake = candidates
    for n in range(count):
        if travelled < wake[n]:
            continue
        v, t = vertex[n], triangle[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        height = height_over_triangle(position, v, a, b, c)
        if wake[n] >= 0.0:
            # It slept, so it has not touched since: whatever side it is on now is right.
            side[n] = 1.0 if height >= 0.0 else -1.0
        height *= side[n]
        if height >= thickness:
            wake[n] = travelled + height - thickness
            continue
        wa, wb, wc = closest_on_triangle(
            position[v, 0], position[v, 1], position[v, 2], position, a, b, c
        )
        x = position[v, 0] - wa * position[a, 0] - wb * position[b, 0] - wc * position[c, 0]
        y = position[v, 1] - wa * position[a, 1] - wb * position[b, 1] - wc * position[c, 1]
        z = position[v, 2] - wa * position[a, 2] - wb * position[b, 2] - wc * position[c, 2]
        distance = math.sqrt(x * x + y * y + z * z)
        if wa > 0.0 and wb > 0.0 and wc > 0.0:
            gap = height
            sign = 1.0 if height > 0.0 else -1.0
        else:
            gap = distance
            sign = 1.0
            if height < 0.0:
                side[n] = -side[n]
        if gap >= thickness:
            wake[n] = travelled + gap - thickness
            continue
        wake[n] = -1.0
        if distance < 1e-9:
            continue
        sign /= distance
        _push_apart(
            position,
            previous,
            (v, a, b, c),
            (wa, wb, wc),
            (x * sign, y * sign, z * sign),
            min(thickness - gap, thickness),
            friction,
            separation,
        )


@njit(cache=True, inline="always")
def _push_apart(
    position: FloatArray,
    previous: FloatArray,
    corners: tuple[int, int, int, int],
    weights: tuple[float, float, float],
    normal: tuple[float, float, float],
    depth: float,
    friction: float,
    separation: float,
) -> None:
    """Move a vertex and a triangle of equal masses apart by `depth`, and brake their sliding.

    They part by no more than `separation` (metres in a substep).
    """
    v, a, b, c = corners
    wa, wb, wc = weights
    nx, ny, nz = normal
    share = 1.0 / (1.0 + wa * wa + wb * wb + wc * wc)
    sx = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 0)
    sy = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 1)
    sz = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 2)
    along = sx * nx + sy * ny + sz * nz
    depth = min(depth, max(separation - along, 0.0))
    sx -= along * nx
    sy -= along * ny
    sz -= along * nz
    slide = math.sqrt(sx * sx + sy * sy + sz * sz)
    brake = 1.0
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


@njit(cache=True, inline="always")
def _relative_way(
    position: FloatArray,
    previous: FloatArray,
    v: int,
    a: int,
    b: int,
    c: int,
    wa: float,
    wb: float,
    wc: float,
    k: int,
) -> float:
    """Way of vertex v in this substep against the triangle's point below it, along axis k."""
    return (
        position[v, k]
        - previous[v, k]
        - wa * (position[a, k] - previous[a, k])
        - wb * (position[b, k] - previous[b, k])
        - wc * (position[c, k] - previous[c, k])
    )


@njit(cache=True)
def collide_with_desk(
    position: FloatArray,
    previous: FloatArray,
    height: float,
    friction: float,
    separation: float = math.inf,
) -> None:
    """Keep vertices at least `height` over the desk (z = 0) and brake their sliding on it.

    A vertex that is too low rises by no more than `separation` (metres in a substep).
    """
    for v in range(position.shape[0]):
        depth = height - position[v, 2]
        if depth <= 0.0:
            continue
        depth = min(depth, max(previous[v, 2] - position[v, 2] + separation, 0.0))
        position[v, 2] += depth
        x = position[v, 0] - previous[v, 0]
        y = position[v, 1] - previous[v, 1]
        slide = math.sqrt(x * x + y * y)
        brake = 1.0
        if slide > friction * depth:
            brake = friction * depth / slide
        position[v, 0] -= brake * x
        position[v, 1] -= brake * y
