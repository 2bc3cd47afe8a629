"""Bending between neighbouring cells about the side they share, with a rest angle.

The quadratic bending of `constraints.resist_bending` wants the flat sheet back. A sheet that has
taken on a crumpled rest shape needs angles: each side between two cells is a hinge whose moment
grows with the turn from its rest angle (the angular model of the reference, Blender's cloth). The
forces are soft beside those of the membrane, so they are integrated explicitly and looked up anew
only every few substeps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray

Positions = NDArray[Any]  # in single or double precision


def cell_hinges(vertices: tuple[int, int]) -> IndexArray:
    """List the hinges of a sheet's mesh, shape (H, 6).

    A row holds the two ends of the side, the two other corners of the cell on one side, and those
    of the cell on the other.
    """
    index = np.arange(vertices[0] * vertices[1], dtype=np.int32).reshape(vertices)
    along_x = _hinges_across_columns(index)
    along_y = _hinges_across_columns(index.T)
    # Transposing mirrors the cells; swapping the ends keeps the sign of an angle the same.
    return np.ascontiguousarray(np.concatenate([along_x, along_y[:, [1, 0, 2, 3, 4, 5]]]))


def hinge_angles(position: Positions, hinges: IndexArray) -> FloatArray:
    """Angles by which the cells at each hinge are turned against each other, (H,), radians."""
    angles = np.empty(len(hinges))
    _measure_angles(position, hinges, angles)
    return angles


@njit(cache=True)
def turn_hinges(
    position: Positions,
    hinges: IndexArray,
    rest_angles: FloatArray,
    gains: FloatArray,
    stiffness: float,
    acceleration: FloatArray,
) -> None:
    """Work out the accelerations (V, 3), m/s^2, by which hinges seek their rest angles.

    Each cell is pushed along its normal at its far corners, and the side takes the opposite push.
    A radian makes `stiffness` (bending rigidity over vertex mass, m^2/s^2) times the hinge's gain
    (1/m) of acceleration at each corner.
    """
    acceleration[:] = 0.0
    normals = np.empty(6)
    for h in range(hinges.shape[0]):
        angle = _angle(position, hinges, h, normals)
        turn = angle - rest_angles[h]
        if turn > math.pi:
            turn -= 2.0 * math.pi
        elif turn < -math.pi:
            turn += 2.0 * math.pi
        push = stiffness * gains[h] * turn
        for k in range(3):
            first = push * normals[k]
            second = push * normals[3 + k]
            acceleration[hinges[h, 2], k] += first
            acceleration[hinges[h, 3], k] += first
            acceleration[hinges[h, 4], k] += second
            acceleration[hinges[h, 5], k] += second
            acceleration[hinges[h, 0], k] -= first + second
            acceleration[hinges[h, 1], k] -= first + second


@njit(cache=True)
def _measure_angles(position: Positions, hinges: IndexArray, angles: FloatArray) -> None:
    normals = np.empty(6)
    for h in range(hinges.shape[0]):
        angles[h] = _angle(position, hinges, h, normals)


@njit(cache=True)
def _angle(position: Positions, hinges: IndexArray, h: int, normals: FloatArray) -> float:
    """Signed angle at a hinge, radians; `normals` gets the unit normals of its two cells."""
    i, j = hinges[h, 0], hinges[h, 1]
    ex = position[j, 0] - position[i, 0]
    ey = position[j, 1] - position[i, 1]
    ez = position[j, 2] - position[i, 2]
    for side in range(2):
        p, q = hinges[h, 2 + 2 * side], hinges[h, 3 + 2 * side]
        # The far side's middle seen from one end of the hinge; along the hinge it may slide.
        mx = 0.5 * (position[p, 0] + position[q, 0]) - position[i, 0]
        my = 0.5 * (position[p, 1] + position[q, 1]) - position[i, 1]
        mz = 0.5 * (position[p, 2] + position[q, 2]) - position[i, 2]
        sign = 1.0 - 2.0 * side
        nx = sign * (ey * mz - ez * my)
        ny = sign * (ez * mx - ex * mz)
        nz = sign * (ex * my - ey * mx)
        scale = 1.0 / max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-15)
        normals[3 * side] = nx * scale
        normals[3 * side + 1] = ny * scale
        normals[3 * side + 2] = nz * scale
    cosine = normals[0] * normals[3] + normals[1] * normals[4] + normals[2] * normals[5]
    sine = (
        (normals[1] * normals[5] - normals[2] * normals[4]) * ex
        + (normals[2] * normals[3] - normals[0] * normals[5]) * ey
        + (normals[0] * normals[4] - normals[1] * normals[3]) * ez
    ) / max(math.sqrt(ex * ex + ey * ey + ez * ez), 1e-15)
    return math.atan2(sine, cosine)


def _hinges_across_columns(index: IndexArray) -> IndexArray:
    """Hinges along the second axis of a grid of indices, between cells along its first."""
    ends = [index[1:-1, :-1], index[1:-1, 1:]]
    first = [index[:-2, :-1], index[:-2, 1:]]
    second = [index[2:, :-1], index[2:, 1:]]
    return np.stack([*ends, *first, *second], axis=-1).reshape(-1, 6)
