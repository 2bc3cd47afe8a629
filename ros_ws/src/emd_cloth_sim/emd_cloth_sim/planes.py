"""The layout in which the constraints of the sheet run many at a time.

Every row of the mesh (fixed i) is three runs of `PITCH` numbers, one each for x, y and z. In a
run the vertices with even j come first and those with odd j from `HALF` on. So the members of one
colour of constraints lie side by side, at distances the compiler knows, and it handles `LANES` of
them with one instruction; the surplus lanes at the end of a run are given no weight.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

HALF = 64
PITCH = 2 * HALF
ROW = 3 * PITCH
LANES = 16
MAX_VERTICES = 2 * (HALF - 1)
# No kernel relies on NaN, on signed zeros or on the order of a sum; the machine code is fixed, so
# results are still the same to the bit from run to run.
FAST: dict[str, Any] = {"cache": True, "fastmath": True, "error_model": "numpy"}

Plane = NDArray[np.float32]
# A number in single precision; mypy cannot follow what Numba makes of arithmetic with it.
Single: TypeAlias = Any


def empty_planes(rows: int) -> Plane:
    """Make room for x, y and z of `rows` rows of vertices; shape (rows * ROW,)."""
    return np.zeros(rows * ROW, dtype=np.float32)


def to_plane(values: NDArray[Any]) -> Plane:
    """Arrange one number for each vertex (N_x, N_y) as a run a row; shape (N_x * PITCH,)."""
    rows, columns = values.shape
    plane = np.zeros((rows, 2, HALF), dtype=np.float32)
    plane[:, 0, : (columns + 1) // 2] = values[:, 0::2]
    plane[:, 1, : columns // 2] = values[:, 1::2]
    return plane.ravel()


@njit(**FAST)
def load_planes(position: NDArray[np.float32], planes: Plane, rows: int, columns: int) -> None:
    """Copy positions, shape (V, 3), into planes."""
    for i in range(rows):
        for j in range(columns):
            v = i * columns + j
            at = i * ROW + (j & 1) * HALF + (j >> 1)
            planes[at] = position[v, 0]
            planes[at + PITCH] = position[v, 1]
            planes[at + 2 * PITCH] = position[v, 2]


@njit(**FAST)
def store_planes(planes: Plane, position: NDArray[np.float32], rows: int, columns: int) -> None:
    """Copy planes back into positions, shape (V, 3)."""
    for i in range(rows):
        for j in range(columns):
            v = i * columns + j
            at = i * ROW + (j & 1) * HALF + (j >> 1)
            position[v, 0] = planes[at]
            position[v, 1] = planes[at + PITCH]
            position[v, 2] = planes[at + 2 * PITCH]
