"""Whether hands took cloth along, judged from what the camera saw before and after."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from emd_arm_executor.config import SightConfig
from emd_arm_executor.grasp import GraspPose
from emd_arm_executor.silhouette import Silhouette
from emd_core.frames import FloatArray

# Distance between the places at which two silhouettes are compared, metres.
_STEP = 0.001


def hem_moved(
    grasps: Mapping[str, GraspPose],
    before: Silhouette,
    after: Silhouette,
    config: SightConfig | None = None,
) -> dict[str, bool]:
    """Tell for each arm whether the cloth has moved at the hem that it gripped.

    Args:
        grasps: How each arm gripped.
        before: The cloth before the manipulation.
        after: The cloth when the arms have left it.
        config: How much must have changed.

    Returns:
        Nothing for an arm at whose hem too much is hidden, before or after.
    """
    config = config or SightConfig()
    shares = {
        arm: changed_share(before, after, grasp.hem.point_in_table, config.radius)
        for arm, grasp in grasps.items()
    }
    return {arm: share >= config.moved_share for arm, share in shares.items() if share is not None}


def changed_share(
    before: Silhouette, after: Silhouette, point_in_table: FloatArray, radius: float
) -> float | None:
    """Compare two silhouettes around a point, where nothing hides either.

    A folded hem leaves the table bare, one that was pulled covers what was bare.

    Args:
        before: The cloth.
        after: The cloth later.
        point_in_table: Shape (2,), metres.
        radius: How far around it counts, metres.

    Returns:
        Of the area that is covered in one or both of them, the share that is covered in one only,
        0..1; 0 if none is covered, None if half of the places or more are hidden.
    """
    axis = np.arange(-radius, radius + _STEP / 2, _STEP)
    offsets = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    places = point_in_table + offsets[np.hypot(*offsets.T) <= radius]
    seen = ~(before.hides(places) | after.hides(places))
    if 2 * np.count_nonzero(seen) <= len(places):
        return None
    first, second = before.covers(places[seen]), after.covers(places[seen])
    either = int(np.count_nonzero(first | second))
    return int(np.count_nonzero(first ^ second)) / max(either, 1)
