"""What a demonstration leaves behind: report.json, a strip of pictures, a GIF."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from emd_core.errors import CellError
from emd_core.metrics import voxel_iou, voxel_mse
from emd_core.voxel_grid import VoxelGrid
from emd_core.whole_file import whole_file, write_text

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen first)


@dataclass(frozen=True)
class Score:
    """How far the cloth is from the goal.

    Attributes:
        voxel_mse: By the simulator's own state.
        voxel_iou: By the simulator's own state.
        camera_voxel_mse: As perception sees it.
    """

    voxel_mse: float
    voxel_iou: float
    camera_voxel_mse: float

    @classmethod
    def of(cls, truth: VoxelGrid, seen: VoxelGrid, goal: VoxelGrid) -> Score:
        """Compare the true and the perceived grid with the goal."""
        return cls(voxel_mse(truth, goal), voxel_iou(truth, goal), voxel_mse(seen, goal))


@dataclass
class StepReport:
    """One round of perceiving, planning and executing.

    Attributes:
        plan_ms: Milliseconds of planning.
        predicted_mse: Predicted loss_s of the plan's last state.
        planned: The first manipulation as planned, metres, table frame.
        grasped: The same as carried out at the hem.
        executed: Score after it, or None if it was not carried out.
        error: What went wrong, or None.
    """

    plan_ms: float | None = None
    predicted_mse: float | None = None
    planned: dict[str, Any] | None = None
    grasped: dict[str, Any] | None = None
    executed: Score | None = None
    error: dict[str, Any] | None = None


@dataclass
class DemoReport:
    """The whole run; `write` makes report.json of it."""

    goal: str
    seed: int
    command: str
    initial: Score | None = None
    final: Score | None = None
    steps: list[StepReport] = field(default_factory=list)
    error: dict[str, Any] | None = None
    seconds: float = 0.0

    @property
    def carried_out(self) -> int:
        """Manipulations that were carried out; planned ones that were refused do not count."""
        return sum(step.executed is not None for step in self.steps)

    def write(self, path: Path) -> None:
        """Write the report, whole or not at all."""
        write_text(path, json.dumps(asdict(self), indent=1))


def error_entry(err: CellError) -> dict[str, Any]:
    """An error as the report holds it."""
    return {"code": int(err.code), "name": err.code.name, "message": str(err)}


@dataclass(frozen=True)
class StripColumn:
    """One column of the strip: a title, a grid, and a picture of the scene if there is one."""

    title: str
    grid: VoxelGrid
    picture: NDArray[np.uint8] | None = None


def write_strip(path: Path, columns: list[StripColumn]) -> None:
    """Draw the grids as height maps, as the head camera sees them, above pictures of the scene."""
    figure, axes = plt.subplots(
        2, len(columns), figsize=(3.2 * len(columns), 5.6), layout="constrained", squeeze=False
    )
    for axis, column in zip(axes[0], columns, strict=True):
        fov = column.grid.field_of_view
        side = fov.half_extent * 100
        image = axis.imshow(
            column.grid.height_map * 1000,
            extent=(-side, side, side, -side),
            cmap="viridis",
            vmin=0,
            vmax=6 * fov.resolution[2] * 1000,
        )
        axis.set_title(column.title)
        axis.set_xlabel("y (cm)")
    axes[0, 0].set_ylabel("x (cm), towards the robot")
    figure.colorbar(image, ax=axes[0, -1], label="height (mm)", shrink=0.8)
    for axis, column in zip(axes[1], columns, strict=True):
        axis.axis("off")
        if column.picture is not None:
            axis.imshow(column.picture)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)


def write_gif(path: Path, frames: list[NDArray[np.uint8]], frame_ms: int = 80) -> None:
    """Write frames (H, W, 3) as an endlessly repeated GIF."""
    pictures = [Image.fromarray(frame).quantize(64) for frame in frames]
    with whole_file(path) as temporary:
        pictures[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=frame_ms,
            loop=0,
            optimize=True,
        )
