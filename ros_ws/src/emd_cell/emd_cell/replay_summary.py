"""What became of a bag: summary.json, report.md and a contact sheet."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.voxel_grid import VoxelGrid
from emd_core.whole_file import whole_file, write_text

_TILE = 240  # pixels of a picture's width
_CAPTION = 20  # pixels below it
_COLUMNS = 3  # of the sheet; each has the picture and the grid's height map
_MOST = 24  # frames on the sheet
_REASONS = 10  # kinds of skips in the report

Picture = NDArray[np.uint8]


@dataclass
class ReplaySummary:
    """What became of the frames of a bag.

    Attributes:
        bag: The bag's path as given.
        rate: Recorded seconds to be played a second; 0: as fast as perception answers.
        frames: Colour-depth pairs played.
        grids: One entry for every grid: file, stamp (ns), occupied voxels, quality, reason.
        skipped: One entry for every message or pair without a grid: stamp (ns) and reason.
        clock_jumps: One entry for every jump of the stamps: stamp (ns) and seconds.
        unpaired: Images left out because none of the other kind was taken at the same moment.
        recorded_seconds: From the first to the last pair played, without jumps of the clock.
        seconds: What the replay took.
    """

    bag: str
    rate: float = 0.0
    frames: int = 0
    grids: list[dict[str, Any]] = field(default_factory=list)
    skipped: list[dict[str, Any]] = field(default_factory=list)
    clock_jumps: list[dict[str, Any]] = field(default_factory=list)
    unpaired: int = 0
    recorded_seconds: float = 0.0
    seconds: float = 0.0

    def skip(self, stamp: int, reason: str) -> None:
        """Count what gave no grid."""
        self.skipped.append({"stamp": stamp, "reason": reason})

    def write(self, out: Path) -> None:
        """Write summary.json and report.md to a folder, each whole or not at all."""
        write_text(out / "summary.json", json.dumps(asdict(self), indent=1) + "\n")
        write_text(out / "report.md", "\n".join(self._lines()) + "\n")

    def describe(self) -> str:
        """Say in a line what was played."""
        speed = self.recorded_seconds / max(self.seconds, 1e-9)
        return (
            f"{self.frames} pairs of images, {len(self.grids)} grids, {len(self.skipped)} "
            f"skipped, {len(self.clock_jumps)} jumps of the clock, {self.unpaired} images "
            f"without a partner; {self.recorded_seconds:.1f} s of recording in "
            f"{self.seconds:.1f} s ({speed:.2f} times real time)"
        )

    def _lines(self) -> list[str]:
        lines = [f"# Replay of {self.bag}", "", f"{self.describe()}.", ""]
        if self.grids:
            quality = np.array([entry["quality"] for entry in self.grids])
            lines += [
                f"Quality of the grids: {quality.mean():.2f} on average, {quality.min():.2f} at "
                "the least.",
                "",
            ]
        reasons = Counter(entry["reason"] for entry in self.skipped).most_common()
        if reasons:
            lines += ["| skipped | reason |", "|---|---|"]
            lines += [f"| {count} | {reason} |" for reason, count in reasons[:_REASONS]]
            if len(reasons) > _REASONS:
                lines.append(f"| | and {len(reasons) - _REASONS} more reasons in summary.json |")
            lines.append("")
        lines += [
            f"- The stamps jumped by {entry['seconds']:.1f} s at {entry['stamp']}."
            for entry in self.clock_jumps
        ]
        lines += [""] if lines[-1] else []
        return [*lines, "![The frames, evenly chosen](contact_sheet.png)"]


class ContactSheet:
    """Keeps small pictures of evenly chosen frames, few however long the bag is."""

    def __init__(self) -> None:
        """Start without frames."""
        self._tiles: list[Picture] = []
        self._every = 1
        self._seen = 0

    @property
    def wants_next(self) -> bool:
        """Whether the next frame is one of those that are kept."""
        return self._seen % self._every == 0

    def add(
        self,
        colour: Picture | None,
        mask: NDArray[np.bool_] | None,
        grid: VoxelGrid | None,
        caption: str,
    ) -> None:
        """Take a frame.

        Args:
            colour: Shape (H, W, 3), RGB; None if it cannot be decoded.
            mask: The cloth's pixels, shape (H, W), if it was found.
            grid: The cloth's grid, if it was found.
            caption: Under it.
        """
        if self.wants_next:
            self._tiles.append(_tile(colour, mask, grid, caption))
        self._seen += 1
        if len(self._tiles) > _MOST:
            self._tiles = self._tiles[::2]
            self._every *= 2

    def write(self, path: Path) -> None:
        """Write the sheet as a picture; none if there was no frame."""
        if not self._tiles:
            return
        height = max(tile.shape[0] for tile in self._tiles)
        tiles = [
            np.pad(tile, ((0, height - tile.shape[0]), (0, 0), (0, 0)), constant_values=255)
            for tile in self._tiles
        ]
        columns = min(_COLUMNS, len(tiles))
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % columns)
        rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
        with whole_file(path) as temporary:
            cv2.imwrite(str(temporary), np.vstack(rows)[..., ::-1])


def _tile(
    colour: Picture | None,
    mask: NDArray[np.bool_] | None,
    grid: VoxelGrid | None,
    caption: str,
) -> Picture:
    """Picture with the cloth's outline, height map beside it, caption below."""
    picture = np.full((180, _TILE, 3), 200, np.uint8) if colour is None else _small(colour, mask)
    side = picture.shape[0]
    heights = np.full((side, side, 3), 235, np.uint8)
    if grid is not None:
        levels = grid.occupancy.sum(axis=2).astype(np.float32) * (255.0 / 6.0)
        coloured = cv2.applyColorMap(
            np.clip(levels, 0, 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS
        )
        heights = cv2.resize(coloured[..., ::-1], (side, side), interpolation=cv2.INTER_NEAREST)
    tile = np.hstack([picture, heights])
    tile = cv2.copyMakeBorder(tile, 0, _CAPTION, 0, 6, cv2.BORDER_CONSTANT, value=(255,) * 3)
    plain = caption.encode("ascii", "replace").decode()
    place = (2, tile.shape[0] - 6)
    cv2.putText(tile, plain[:64], place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0,) * 3, 1, cv2.LINE_AA)
    return np.asarray(tile, dtype=np.uint8)


def _small(colour: Picture, mask: NDArray[np.bool_] | None) -> Picture:
    size = (_TILE, max(8, round(_TILE * colour.shape[0] / colour.shape[1])))
    picture = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)
    if mask is not None and mask.shape == colour.shape[:2]:
        small = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(small, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(picture, outlines, -1, (255, 40, 40), 1)
    return np.asarray(picture, dtype=np.uint8)
