"""The picture of a reach map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from emd_cell.reach_command import draw_reach_map
from emd_core.reach_map import ReachMap


def test_the_picture_shows_arms_and_both(tmp_path: Path) -> None:
    """Two rows of three tables, in more than one colour."""
    axis = np.linspace(-0.3, 0.3, 7)
    grasp = np.random.default_rng(0).random((2, 4, 7, 7)) < 0.5
    reach = ReachMap(("left", "right"), axis, np.arange(4) * np.pi / 2, grasp, ~grasp)
    draw_reach_map(reach, tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as image:
        assert image.width > image.height > 400
        assert len(image.convert("RGB").getcolors(1 << 24)) > 50
