"""One executed manipulation with what was seen before and after it: an example to learn from."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from emd_console.cell_port import Observation
from emd_console.motion import MotionLog
from emd_core.manipulation import Manipulation
from emd_core.sequence_shard import SequenceShard
from emd_core.voxel_grid import VoxelGrid

SHARD = "shard_00000.npz"
ENTRY = "example.json"
_THUMBNAIL = (320, 240)


@dataclass(frozen=True)
class Example:
    """What is kept of an execution.

    Attributes:
        before: What was seen before.
        after: What was seen after.
        planned: The manipulation asked for.
        executed: With the hem points at which the hands really grasped.
        kind: taught or planned.
        who: Who gave the command.
        goal: What it was meant to reach, or None.
        details: Further figures for the record, as JSON holds them.
        motion: What the robot did, to be kept as a bag; None if that was not recorded.
    """

    before: Observation
    after: Observation
    planned: Manipulation
    executed: Manipulation
    kind: str
    who: str
    goal: VoxelGrid | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    motion: MotionLog | None = None

    def write(self, folder: Path, number: int, time: str, run: str) -> None:
        """Write all files into an empty folder.

        Args:
            folder: Where.
            number: Index of the example in its data set.
            time: When it happened, ISO 8601.
            run: When the run of the console began to which it belongs, ISO 8601.
        """
        self._shard(number).write(folder / SHARD)
        clouds = {
            f"{name}_{moment}": value
            for moment, seen in (("before", self.before), ("after", self.after))
            for name, value in _arrays(seen).items()
        }
        with (folder / "observations.npz").open("wb") as stream:
            np.savez_compressed(stream, **clouds)  # type: ignore[arg-type]
        if self.goal is not None:
            self.goal.save(folder / "goal.npz")
        for moment, seen in (("before", self.before), ("after", self.after)):
            if seen.picture is not None:
                (folder / f"{moment}.jpg").write_bytes(thumbnail(seen.picture))
        entry = self._entry(number, time, run)
        entry["motion"] = self.motion.write(folder) if self.motion else None
        (folder / ENTRY).write_text(json.dumps(entry, indent=1))

    def _shard(self, number: int) -> SequenceShard:
        """The data set of this one sequence; `docs/data_format.md` describes it."""
        fov = self.before.grid.field_of_view
        values = self.executed.to_network(fov).astype(np.float32)
        grids = [np.packbits(seen.grid.occupancy) for seen in (self.before, self.after)]
        arrays: dict[str, NDArray[Any]] = {
            "grids": np.stack(grids)[None],
            "picks": values[:4].reshape(1, 1, 2, 2),
            "moves": values[4:].reshape(1, 1, 2),
            "indices": np.array([number], dtype=np.int64),
        }
        meta = {"recorded": True, "field_of_view": asdict(fov)}
        return SequenceShard(arrays, (), meta)

    def _entry(self, number: int, time: str, run: str) -> dict[str, Any]:
        return {
            "number": number,
            "time": time,
            "run": run,
            "kind": self.kind,
            "who": self.who,
            "planned": self.planned.as_entry(),
            "executed": self.executed.as_entry(),
            "quality": [self.before.quality, self.after.quality],
            "hidden_columns": [_hidden_columns(seen) for seen in (self.before, self.after)],
            **self.details,
        }


def thumbnail(picture: NDArray[np.uint8]) -> bytes:
    """Shrink a picture (H, W, 3) to a small JPEG."""
    image = Image.fromarray(picture)
    image.thumbnail(_THUMBNAIL)
    stream = io.BytesIO()
    image.save(stream, format="JPEG", quality=85)
    return stream.getvalue()


def _hidden_columns(seen: Observation) -> int:
    return 0 if seen.grid.unknown is None else int(seen.grid.unknown.sum())


def _arrays(seen: Observation) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "mask": np.packbits(seen.mask > 0),
        "mask_shape": np.array(seen.mask.shape),
        "points": seen.points_in_table.astype(np.float32),
    }
    if seen.grid.unknown is not None:
        arrays["unknown"] = np.packbits(seen.grid.unknown)
    if seen.cloth_states is not None:
        arrays["cloth_states"] = seen.cloth_states.astype(np.float32)
    return arrays
