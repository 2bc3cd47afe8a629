"""Joint positions along a dense path of tool poses."""

from __future__ import annotations

import numpy as np

from emd_arm_executor.kinematics import ArmKinematics, Attempt
from emd_core.errors import OutOfReachError
from emd_core.frames import FloatArray


def follow_poses(
    arm: ArmKinematics,
    transforms_tool_to_base: FloatArray,
    start: FloatArray,
    max_step: float | None = None,
) -> FloatArray:
    """Follow a dense path of tool poses without leaving the branch of `start`.

    Each pose is solved from where the two before it point to, so one or two steps are enough.

    Args:
        arm: The arm.
        transforms_tool_to_base: Poses, shape (N, 4, 4), a few millimetres apart.
        start: Joint positions at the first pose, or near it, shape (n,), radians.
        max_step: Largest change of a joint between poses, radians; as configured if None.

    Returns:
        Joint positions, shape (N, n), radians.

    Raises:
        OutOfReachError: If the path leaves the workspace or would need a jump of a joint;
            names the pose and how far along the path it is.
    """
    limit = arm.config.max_joint_step if max_step is None else max_step
    path = np.empty((len(transforms_tool_to_base), len(start)))
    positions = np.asarray(start, dtype=np.float64)
    for i, transform in enumerate(transforms_tool_to_base):
        guess = positions if i < 2 else 2.0 * path[i - 1] - path[i - 2]
        attempt = arm.descend(transform, guess)
        jump = float(np.abs(attempt.positions - positions).max())
        if not attempt.solved or (i > 0 and jump > limit):
            raise _lost(arm, transform, attempt, jump, (i, len(path)))
        positions = path[i] = attempt.positions
    return path


def _lost(
    arm: ArmKinematics,
    transform: FloatArray,
    attempt: Attempt,
    jump: float,
    place: tuple[int, int],
) -> OutOfReachError:
    """Say where and why an arm left a path; `place` is the pose's index and their number."""
    x, y, z = transform[:3, 3]
    if attempt.solved:
        reason = f"a joint would have to jump by {np.rad2deg(jump):.0f} degrees"
    else:
        reason = (
            f"it comes within {attempt.distance * 1e3:.1f} mm and "
            f"{np.rad2deg(attempt.angle):.1f} degrees"
        )
    return OutOfReachError(
        f"the {arm.name} arm cannot follow its path to ({x:.3f}, {y:.3f}, {z:.3f}) m in the base "
        f"frame, pose {place[0] + 1} of {place[1]}: {reason}; choose a shorter displacement or "
        "another grasp direction"
    )
