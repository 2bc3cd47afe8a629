"""What became of many folds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def summarise(records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Count grasps and compare errors with and without the robot."""
    tried = [record for record in records if record["grasps"] > 0]
    pairs = np.array(
        [
            (record["voxel_mse"], record["voxel_mse_without_robot"], record["idle_mse"])
            for record in records
            if record.get("voxel_mse_without_robot") is not None
        ]
    ).reshape(-1, 3)
    with_robot, without, idle = pairs.mean(axis=0) if len(pairs) else [None] * 3
    seconds = [record["seconds"] for record in records if "seconds" in record]
    return {
        "goals": len(records),
        "grasps_tried": len(tried),
        "grasped_at_once": sum(record["grasped"] for record in tried),
        "grasp_success": _share(sum(record["grasped"] for record in tried), len(tried)),
        "folded": len(seconds),
        "not_folded": [record["error"] for record in records if record["error"]],
        "plans_refused_by_the_arms": sum(len(record["refusals"]) for record in records),
        "voxel_mse": with_robot,
        "voxel_mse_without_robot": without,
        "voxel_mse_do_nothing": idle,
        "robot_over_without": _share(with_robot, without),
        "plan_ms_p50": _median([r["plan_ms"] for r in records if "plan_ms" in r]),
        "seconds_p50": _median(seconds),
        "folds_an_hour": 3600.0 / float(np.mean(seconds)) if seconds else None,
    }


def _share(part: float | None, whole: float | None) -> float | None:
    return part / whole if part is not None and whole else None


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
