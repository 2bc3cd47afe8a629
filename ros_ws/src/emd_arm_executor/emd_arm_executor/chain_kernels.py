"""Compiled kernels of a serial chain: forward kinematics and damped least squares.

All of them are in this one file: Numba compiles a kernel anew when its own file has changed, but
not when that of a kernel it calls has. A chain of n joints is one array `links` of shape
(n + 1, 3, 5): fixed rotation before joint k (columns 0 to 2), the translation that goes with it
(column 3, metres) and the joint's axis in its own frame (column 4); the last row is the tool's.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

_TINY = 1e-12


@numba.njit(cache=True, error_model="numpy")
def _multiply(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@numba.njit(cache=True, error_model="numpy")
def _turn(axis: FloatArray, angle: float, out: FloatArray) -> None:
    """Rotation by an angle about a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c


@numba.njit(cache=True, error_model="numpy")
def _place(
    links: FloatArray, q: FloatArray, scratch: FloatArray, joints: FloatArray, tool: FloatArray
) -> None:
    """Fill origins and axes of the joints (n, 2, 3) and the tool's pose (3, 4), base frame."""
    fixed, turned, here = scratch[0], scratch[1], scratch[2]
    for i in range(3):
        tool[i, 3] = 0.0
        for j in range(3):
            here[i, j] = 1.0 if i == j else 0.0
    n = len(q)
    for k in range(n + 1):
        link = links[k]
        for i in range(3):
            for j in range(3):
                tool[i, 3] += here[i, j] * link[j, 3]
        _multiply(here, link, fixed)
        if k == n:
            break
        for i in range(3):
            joints[k, 0, i] = tool[i, 3]
            joints[k, 1, i] = 0.0
            for j in range(3):
                joints[k, 1, i] += fixed[i, j] * link[j, 4]
        _turn(link[:, 4], q[k], turned)
        _multiply(fixed, turned, here)
    tool[:, :3] = fixed


@numba.njit(cache=True, error_model="numpy")
def tool_poses(links: FloatArray, rows: FloatArray) -> FloatArray:
    """Give the tool's poses in the base frame, shape (N, 4, 4), for joint positions (N, n)."""
    scratch, tool = np.empty((3, 3, 3)), np.empty((3, 4))
    joints = np.empty((rows.shape[1], 2, 3))
    out = np.zeros((len(rows), 4, 4))
    for r in range(len(rows)):
        _place(links, rows[r], scratch, joints, tool)
        out[r, :3] = tool
        out[r, 3, 3] = 1.0
    return out


@numba.njit(cache=True, error_model="numpy")
def joint_points(links: FloatArray, rows: FloatArray) -> FloatArray:
    """Give the joints' origins and the tool's, shape (N, n + 1, 3), for positions (N, n)."""
    scratch, tool = np.empty((3, 3, 3)), np.empty((3, 4))
    count = rows.shape[1]
    joints = np.empty((count, 2, 3))
    out = np.empty((len(rows), count + 1, 3))
    for r in range(len(rows)):
        _place(links, rows[r], scratch, joints, tool)
        out[r, :count] = joints[:, 0]
        out[r, count] = tool[:, 3]
    return out


@numba.njit(cache=True, error_model="numpy")
def _rotation_vector(current: FloatArray, target: FloatArray, out: FloatArray) -> float:
    """Rotation vector, base frame, that turns `current` into `target`; returns its angle."""
    # Trace and skew part of target * current^T.
    trace, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        trace += target[0, k] * current[0, k]
        trace += target[1, k] * current[1, k] + target[2, k] * current[2, k]
        v0 += target[2, k] * current[1, k] - target[1, k] * current[2, k]
        v1 += target[0, k] * current[2, k] - target[2, k] * current[0, k]
        v2 += target[1, k] * current[0, k] - target[0, k] * current[1, k]
    sine = 0.5 * np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    if sine > 1e-9:
        scale = 0.5 * angle / sine
        out[0], out[1], out[2] = scale * v0, scale * v1, scale * v2
    elif angle < 1.0:
        out[0], out[1], out[2] = 0.5 * v0, 0.5 * v1, 0.5 * v2
    else:  # half a turn: any axis will do, the next step sees another angle
        out[0], out[1], out[2] = 3.0, 0.0, 0.0
    return angle


@numba.njit(cache=True, error_model="numpy")
def _solve_damped(
    jacobian: FloatArray,
    free: NDArray[np.bool_],
    error: FloatArray,
    damping: float,
    scratch: FloatArray,
    change: FloatArray,
) -> None:
    """Give change = J^T (J J^T + damping)^-1 error on the free joints, by Cholesky."""
    n, normal, weights = jacobian.shape[1], scratch[:6], scratch[6]
    for i in range(6):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(n):
                if free[k]:
                    total += jacobian[i, k] * jacobian[j, k]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(max(total, 1e-30)) if i == j else total / normal[j, j]
    for i in range(6):
        total = error[i]
        for k in range(i):
            total -= normal[i, k] * weights[k]
        weights[i] = total / normal[i, i]
    for i in range(5, -1, -1):
        total = weights[i]
        for k in range(i + 1, 6):
            total -= normal[k, i] * weights[k]
        weights[i] = total / normal[i, i]
    for k in range(n):
        total = 0.0
        if free[k]:
            for i in range(6):
                total += jacobian[i, k] * weights[i]
        change[k] = total


@numba.njit(cache=True, error_model="numpy")
def _step(
    q: FloatArray,
    limits: FloatArray,
    jacobian: FloatArray,
    error: FloatArray,
    settings: FloatArray,
    scratch: FloatArray,
    change: FloatArray,
) -> None:
    """Move the joints one damped step; those pushed through a limit leave the active set."""
    n = len(q)
    free = np.ones(n, dtype=np.bool_)
    damping = settings[2] * (error**2).sum() + _TINY
    for _ in range(n):
        _solve_damped(jacobian, free, error, damping, scratch, change)
        blocked = False
        for k in range(n):
            above = q[k] >= limits[1, k] and change[k] > 0.0
            below = q[k] <= limits[0, k] and change[k] < 0.0
            if free[k] and (above or below):
                free[k], blocked = False, True
        if not blocked:
            break
    scale = min(1.0, settings[3] / max(np.abs(change).max(), _TINY))
    for k in range(n):
        q[k] = min(max(q[k] + scale * change[k], limits[0, k]), limits[1, k])


@numba.njit(cache=True, error_model="numpy")
def _linearise(joints: FloatArray, tool: FloatArray, jacobian: FloatArray) -> None:
    """Fill the geometric Jacobian (6, n) of the tool, base frame: linear, then angular."""
    for k in range(len(joints)):
        o, a = joints[k, 0], joints[k, 1]
        x, y, z = tool[0, 3] - o[0], tool[1, 3] - o[1], tool[2, 3] - o[2]
        jacobian[0, k] = a[1] * z - a[2] * y
        jacobian[1, k] = a[2] * x - a[0] * z
        jacobian[2, k] = a[0] * y - a[1] * x
        jacobian[3, k], jacobian[4, k], jacobian[5, k] = a[0], a[1], a[2]


@numba.njit(cache=True, error_model="numpy")
def jacobian_of_tool(links: FloatArray, q: FloatArray) -> FloatArray:
    """Give the geometric Jacobian (6, n) of the tool, base frame: linear, then angular."""
    scratch, tool, joints = np.empty((3, 3, 3)), np.empty((3, 4)), np.empty((len(q), 2, 3))
    _place(links, q, scratch, joints, tool)
    jacobian = np.empty((6, len(q)))
    _linearise(joints, tool, jacobian)
    return jacobian


@numba.njit(cache=True, error_model="numpy")
def descend(
    links: FloatArray,
    limits: FloatArray,
    target: FloatArray,
    seed: FloatArray,
    settings: FloatArray,
) -> tuple[FloatArray, float, float]:
    """Walk from a seed to a target by damped least squares inside the limits.

    Args:
        links: The chain.
        limits: Lower and upper positions, shape (2, n), radians.
        target: Pose of the tool in the base frame, shape (4, 4).
        seed: Start, shape (n,), radians.
        settings: Most steps, steps without progress, damping, largest change of a joint in a step
            (radians), tolerated distance (metres) and angle (radians), metres that count like a
            radian; shape (7,).

    Returns:
        The best joint positions met (n,), their distance (metres) and angle (radians).
    """
    n = len(seed)
    scratch, solver = np.empty((3, 3, 3)), np.empty((7, 6))
    tool, joints = np.empty((3, 4)), np.empty((n, 2, 3))
    error, jacobian, change = np.empty(6), np.empty((6, n)), np.empty(n)
    q = np.minimum(np.maximum(seed, limits[0]), limits[1])
    best, best_cost, stalled = q.copy(), np.inf, 0
    best_distance, best_angle = np.inf, np.inf
    for _ in range(int(settings[0])):
        _place(links, q, scratch, joints, tool)
        for i in range(3):
            error[i] = target[i, 3] - tool[i, 3]
        angle = _rotation_vector(tool, target, error[3:])
        distance = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        cost = distance + settings[6] * angle
        stalled = 0 if cost < 0.97 * best_cost else stalled + 1
        if cost < best_cost:
            best[:] = q
            best_cost, best_distance, best_angle = cost, distance, angle
        if (distance < settings[4] and angle < settings[5]) or stalled > settings[1]:
            break
        _linearise(joints, tool, jacobian)
        _step(q, limits, jacobian, error, settings, solver, change)
    return best, best_distance, best_angle


@numba.njit(cache=True, error_model="numpy")
def pose_costs(poses: FloatArray, target: FloatArray, lever: float) -> FloatArray:
    """Give squared distances of poses (N, 4, 4) from a target (4, 4), angles on a lever (N,)."""
    costs = np.empty(len(poses))
    for r in range(len(poses)):
        squared, trace = 0.0, 0.0
        for i in range(3):
            squared += (poses[r, i, 3] - target[i, 3]) ** 2
            for j in range(3):
                trace += poses[r, i, j] * target[i, j]
        # 3 - trace = 2 (1 - cos(angle)), about the squared angle.
        costs[r] = squared + lever * lever * (3.0 - trace)
    return costs
