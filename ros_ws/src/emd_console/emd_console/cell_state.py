"""The latest of everything that came from the cell, shared between threads."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from emd_console.health import NodeHealth, Report, node_health
from emd_console.outline import Polygon
from emd_console.projection import TableProjection
from emd_console.robot_view import RobotView
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid

_MOST_LOSSES = 400


@dataclass(frozen=True)
class Search:
    """A search of the planner, as its feedback tells.

    Attributes:
        goal: Identity of the request.
        losses: Lowest predicted loss after each feedback: iteration, loss.
        best: The best plan's manipulations.
        received: Monotonic seconds of the last feedback.
    """

    goal: bytes = b""
    losses: tuple[tuple[int, float], ...] = ()
    best: tuple[Manipulation, ...] = ()
    received: float = -1e9


@dataclass(frozen=True)
class Motion:
    """A motion of the arms, as the executor's feedback tells.

    Attributes:
        phase: approach, grasp, carry, release, retreat or home; empty before the first feedback.
        progress: Of the whole motion, 0..1.
        received: Monotonic seconds of the last feedback.
    """

    phase: str = ""
    progress: float = 0.0
    received: float = -1e9


@dataclass(frozen=True)
class Snapshot:
    """What is known of the cell at one moment; None: nothing came yet."""

    camera: PinholeCamera | None = None
    transform_camera_to_table: FloatArray | None = None
    outlines: tuple[Polygon, ...] = ()
    grid: VoxelGrid | None = None
    truth: VoxelGrid | None = None
    cloth_states: FloatArray | None = None
    robot: RobotView | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    reports: Mapping[tuple[str, str], Report] = field(default_factory=dict)
    search: Search = field(default_factory=Search)
    motion: Motion = field(default_factory=Motion)
    planning: bool = False
    moving: bool = False

    @property
    def projection(self) -> TableProjection | None:
        """The camera's view of the table, if calibration and pose are known."""
        if self.camera is None or self.transform_camera_to_table is None:
            return None
        return TableProjection(self.camera, self.transform_camera_to_table)


class CellState:
    """Keeps the newest snapshot; writers replace parts of it, readers take it whole."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Know nothing yet; `clock` gives monotonic seconds."""
        self._clock = clock
        self._lock = threading.Lock()
        self._snapshot = Snapshot()

    @property
    def snapshot(self) -> Snapshot:
        """The newest."""
        return self._snapshot

    def update(self, **parts: object) -> None:
        """Replace some parts of the snapshot."""
        with self._lock:
            self._snapshot = replace(self._snapshot, **parts)  # type: ignore[arg-type]

    def report(self, report: Report) -> None:
        """Take a node's status."""
        with self._lock:
            reports = {**self._snapshot.reports, (report.node, report.part): report}
            self._snapshot = replace(self._snapshot, reports=reports)

    def search_feedback(
        self, goal: bytes, iteration: int, loss: float, best: tuple[Manipulation, ...]
    ) -> None:
        """Take a planner's feedback; another goal begins a new curve."""
        with self._lock:
            known = self._snapshot.search
            losses = known.losses if known.goal == goal else ()
            if np.isfinite(loss):
                losses = thinned((*losses, (int(iteration), float(loss))), _MOST_LOSSES)
            search = Search(goal, losses, best, self._clock())
            self._snapshot = replace(self._snapshot, search=search)

    def motion_feedback(self, phase: str, progress: float) -> None:
        """Take the executor's feedback."""
        share = float(np.clip(np.nan_to_num(progress), 0.0, 1.0))
        self.update(motion=Motion(phase, share, self._clock()))

    def health(self) -> list[NodeHealth]:
        """Say how every node is."""
        return node_health(self._snapshot.reports.values(), self._clock())

    def is_silent(self, node: str) -> bool:
        """Whether a node has not been heard of for a while, or never."""
        return any(item.level == "silent" for item in self.health() if item.node == node)

    @property
    def is_moving(self) -> bool:
        """Whether the arms carry something out; a dead executor's last word does not count."""
        return self._snapshot.moving and not self.is_silent("arm_executor")

    @property
    def is_planning(self) -> bool:
        """Whether the planner searches; a dead planner's last word does not count."""
        return self._snapshot.planning and not self.is_silent("planner")


def thinned(losses: tuple[tuple[int, float], ...], most: int) -> tuple[tuple[int, float], ...]:
    """Leave out every second of too many points, the first and the last kept."""
    return losses if len(losses) <= most else (*losses[:-1:2], losses[-1])
