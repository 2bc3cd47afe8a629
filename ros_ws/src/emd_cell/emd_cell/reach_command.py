"""`./cell reach`: where each arm can grasp and let go, as a file for the planner and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import Progress

from emd_arm_executor.reach_map import cached_reach_map
from emd_arm_executor.robot_description import hiro_description, load_description
from emd_arm_executor.robot_model import RobotModel
from emd_core.frames import FloatArray
from emd_core.reach_map import ReachMap
from emd_core.whole_file import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage


def write_reach_map(robot_file: Path | None, folder: Path, console: Console) -> Path:
    """Compute the map of a robot's cell, or take the one kept; draw it; give the file's path.

    Args:
        robot_file: A robot's YAML; HIRO if None.
        folder: Where maps and pictures are kept.
        console: For the progress.

    Raises:
        InvalidInputError: If the robot's file is unusable or nothing can be written.
    """
    description = hiro_description() if robot_file is None else load_description(robot_file)
    robot = RobotModel(description)
    with Progress(console=console) as progress:
        bar = progress.add_task("reach", total=None)
        found = cached_reach_map(
            robot, folder, lambda done, total: progress.update(bar, completed=done, total=total)
        )
    path = folder / f"reach-{found.identity}.npz"
    draw_reach_map(found, path.with_suffix(".png"))
    return path


def draw_reach_map(reach: ReachMap, path: Path) -> None:
    """Draw which share of the directions each arm, and both, can grasp and release.

    Args:
        reach: The map.
        path: PNG file.
    """
    from matplotlib.figure import Figure

    count = len(reach.arms) + 1
    figure = Figure(figsize=(3.2 * count, 6.4), layout="constrained")
    axes = figure.subplots(2, count, squeeze=False)
    for row, (what, masks) in enumerate((("grasp", reach.grasp), ("release", reach.release))):
        shares = [*masks.mean(axis=1), masks.all(axis=0).mean(axis=0)]
        for column, share in enumerate(shares):
            name = reach.arms[column] if column < len(reach.arms) else "both"
            image = _draw(axes[row, column], reach, share)
            axes[row, column].set_title(f"{what}, {name}")
    figure.colorbar(image, ax=axes, label="share of the hand's directions", shrink=0.6)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110)


def _draw(axes: Axes, reach: ReachMap, share: FloatArray) -> AxesImage:
    """Show one arm as the head camera sees the table: x down, y to the right."""
    edge = reach.axis[-1] + reach.step / 2.0
    image = axes.imshow(share, extent=(-edge, edge, edge, -edge), vmin=0.0, vmax=1.0)
    towel = 0.20 * np.array([[-1, -1], [-1, 1], [1, 1], [1, -1], [-1, -1]])
    axes.plot(towel[:, 1], towel[:, 0], "w--", linewidth=1.0)
    axes.set_xlabel("y, m")
    axes.set_ylabel("x, m")
    return image
