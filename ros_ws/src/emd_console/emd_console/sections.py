"""What the page shows, as JSON, in sections that are sent only when they change."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from emd_console.cell_state import CellState, Snapshot
from emd_console.desk import Desk
from emd_console.outcomes import plan_figures
from emd_console.projection import TableProjection
from emd_console.robot_view import Shape
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid

_HANDLE = 0.07  # metres from the grip to the handle that turns the hand


def sections(state: CellState, desk: Desk) -> dict[str, Any]:
    """Give all sections: status, nodes, overlay, grids, search, folds, robot."""
    now = state.snapshot
    return {
        "status": status(state, desk),
        "nodes": [vars(item) for item in state.health()],
        "overlay": overlay(now, desk),
        "grids": grids(now, desk),
        "search": search(state, desk),
        "folds": folds(desk),
        "robot": robot(now),
    }


def status(state: CellState, desk: Desk) -> dict[str, Any]:
    """What is under way, and the last outcome."""
    motion = state.snapshot.motion
    moving = state.is_moving
    return {
        "moving": moving,
        "phase": motion.phase if moving else "",
        "progress": round(motion.progress, 3) if moving else 0.0,
        "planning": state.is_planning,
        "doing": desk.doing,
        "pausing": desk.pausing and bool(desk.doing),
        "message": desk.message,
        "failed": desk.failed,
    }


def overlay(now: Snapshot, desk: Desk) -> dict[str, Any]:
    """What is drawn on the picture, in its pixels."""
    projection = now.projection
    size = [now.camera.width, now.camera.height] if now.camera else [640, 480]
    result: dict[str, Any] = {
        "size": size,
        "outlines": list(now.outlines),
        "lesson": {
            "grasps": desk.lesson.grasps,
            "release": desk.lesson.release,
            "hands": [],
        },
        "arrows": [],
        "check": None,
    }
    if projection is not None:
        shown = desk.shown.plan.manipulations if desk.shown else now.search.best
        if desk.shown or now.planning:
            result["arrows"] = [_arrows(item, projection) for item in shown]
        result["lesson"]["hands"] = _hands(desk, projection)
        result["check"] = _check(desk, projection)
    return result


def grids(now: Snapshot, desk: Desk) -> dict[str, Any]:
    """Heights of the present, the predicted and the goal state."""
    proposal = desk.shown
    predicted = proposal.plan.predicted_grids[-1] if proposal else None
    goal = desk.goal
    return {
        "now": heights(now.grid),
        "predicted": heights(predicted),
        "goal": heights(goal.grid if goal else None),
        "goal_title": goal.title if goal else "",
        "mse_now": _rounded(proposal.mse_now) if proposal else None,
        "steps": len(proposal.plan.manipulations) if proposal else 0,
        "figures": plan_figures(proposal.plan) if proposal else None,
    }


def heights(grid: VoxelGrid | None) -> dict[str, Any] | None:
    """Count the occupied voxels of every column: base64 of uint8, x major; None without a grid."""
    if grid is None:
        return None
    counts = grid.occupancy.sum(axis=2).astype(np.uint8)
    return {"size": list(grid.occupancy.shape), "data": base64.b64encode(counts).decode()}


def search(state: CellState, desk: Desk) -> dict[str, Any]:
    """The loss curve of the last search."""
    losses = state.snapshot.search.losses
    return {
        "losses": [[iteration, round(loss, 6)] for iteration, loss in losses],
        "running": state.is_planning,
    }


def folds(desk: Desk) -> dict[str, Any]:
    """What was carried out, the newest last."""
    rate = desk.folds_an_hour()
    return {
        "count": len(desk.folds),
        "an_hour": None if math.isnan(rate) else round(rate),
        "rows": [
            {
                "example": fold.example,
                "kind": fold.kind,
                "goal": fold.goal,
                "before": _rounded(fold.mse_before),
                "after": _rounded(fold.mse_after),
                "seconds": round(fold.seconds),
            }
            for fold in desk.folds[-20:]
        ],
    }


def robot(now: Snapshot) -> dict[str, Any] | None:
    """The robot's shapes; their poses come apart."""
    if now.robot is None:
        return None
    return {"shapes": shapes(now.robot.shapes), "table": _table(now)}


def shapes(items: Sequence[Shape]) -> list[Any]:
    """Kind, size and colour of each shape."""
    return [[item.kind, list(item.size), item.colour] for item in items]


def _table(now: Snapshot) -> list[float] | None:
    """The table frame in the base frame, 4 x 4 row by row; None if it is not known."""
    if now.robot is None or now.transform_camera_to_table is None:
        return None
    table = now.robot.transform_table_to_base(now.joints, now.transform_camera_to_table)
    return None if table is None else rounded(table)


def rounded(transform: FloatArray) -> list[float]:
    """A pose's 16 numbers, to a millimetre."""
    return [round(float(value), 3) for value in transform.ravel()]


def _arrows(manipulation: Manipulation, projection: TableProjection) -> list[Any]:
    """Grasp and release of each hand that is used, in pixels."""
    used = np.array(manipulation.used)
    ends = np.stack(
        [manipulation.grasp_points_in_table, manipulation.release_points_in_table], axis=1
    )[used]
    return [_pixels(projection, pair) for pair in ends]


def _hands(desk: Desk, projection: TableProjection) -> list[Any]:
    """Handle and grip of each hand of the lesson, in pixels; None where its way is not known."""
    ends = [
        None if grip is None else np.stack([grip[0] - _HANDLE * grip[1], grip[0]])
        for grip in desk.lesson.grips(projection)
    ]
    return [None if pair is None else _pixels(projection, pair) for pair in ends]


def _check(desk: Desk, projection: TableProjection) -> dict[str, Any] | None:
    check = desk.lesson.check
    if check is None:
        return None
    held = check.executed.grasp_points_in_table[np.array(check.executed.used)]
    return {
        "arms": list(check.arms),
        "hems": [_pixels(projection, point[None])[0] for point in held],
        "paths": [_pixels(projection, path) for path in check.carry_paths],
    }


def _pixels(projection: TableProjection, points: FloatArray) -> list[list[float]]:
    """Project points (N, 2) on the table, or (N, 3), to pixels of a tenth."""
    values = np.asarray(points, dtype=np.float64)
    if values.shape[1] == 2:
        values = np.column_stack([values, np.zeros(len(values))])
    pixels: Sequence[Sequence[float]] = np.round(projection.pixels(values), 1).tolist()
    return [list(pixel) for pixel in pixels if all(map(math.isfinite, pixel))]


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 5)
