"""What to generate, and the provenance that goes with the data."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import scipy

import emd_cloth_sim
import emd_core
from emd_cloth_sim.presets import ClothPreset, preset
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView

STARTS = ("flat", "random")


@dataclass(frozen=True)
class GenerationConfig:
    """What to generate.

    Attributes:
        sequences: Sequences to simulate, at least 1; failed ones are not replaced.
        steps: Manipulations in a sequence, at least 1 (paper, IV-A: 3).
        seed: Seed of all sequences; a sequence depends on it, on its index and on what follows,
            not on how many there are, who simulates it or when.
        preset: Name of the cloth and of the hands' path, see `emd_cloth_sim.presets`.
        vertices: Vertices of the mesh along x and y (authors' generator: 81 x 81).
        rule: How manipulations are drawn.
        start: `flat`: centred, parallel to the axes (IV-A); `random`: the outcome of one to three
            manipulations by the same rule that are not recorded.
        shard_size: Sequences in a file.
    """

    sequences: int
    steps: int = 3
    seed: int = 0
    preset: str = "towel"
    vertices: tuple[int, int] = (81, 81)
    rule: ManipulationRule = field(default_factory=ManipulationRule)
    start: str = "flat"
    shard_size: int = 16

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a count or the seed is out of range, the start unknown, or the
                preset unknown or not to be had with this mesh.
        """
        if min(self.sequences, self.steps, self.shard_size) < 1 or self.seed < 0:
            raise InvalidInputError(
                "sequences, steps and shard_size must be at least 1 and the seed at least 0, got "
                f"{self.sequences}, {self.steps}, {self.shard_size} and {self.seed}"
            )
        if self.start not in STARTS:
            raise InvalidInputError(
                f"start must be one of {', '.join(STARTS)}, got {self.start!r}"
            )
        if self.rule.mode == "neat" and self.start != "flat":
            raise InvalidInputError(f"neat folds begin flat, got start {self.start!r}")
        preset(self.preset, self.vertices)

    @property
    def material(self) -> ClothPreset:
        """The cloth and the way in which hands carry it."""
        return preset(self.preset, self.vertices)

    @property
    def shards(self) -> int:
        """Files that all sequences need."""
        return -(-self.sequences // self.shard_size)

    def members(self, shard: int) -> range:
        """Indices of the sequences of a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.sequences))


def provenance(config: GenerationConfig) -> dict[str, Any]:
    """All that a sequence depends on beside its index, as JSON holds it.

    It is that of the process that calls this: each worker tells its own.
    """
    values = {
        "steps": config.steps,
        "seed": config.seed,
        "preset": config.preset,
        **asdict(config.rule),
        "start": config.start,
        "cloth": asdict(config.material.cloth),
        "path": asdict(config.material.path),
        "field_of_view": asdict(FieldOfView()),
        "code_sha256": code_hash(),
        "versions": {
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "numba": numba.__version__,
            "llvmlite": llvmlite.__version__,
        },
    }
    return dict(json.loads(json.dumps(values)))


@functools.cache
def code_hash() -> str:
    """SHA-256 over the sources of emd_core and emd_cloth_sim, without what needs ROS."""
    digest = hashlib.sha256()
    for package in (emd_core, emd_cloth_sim):
        root = Path(package.__path__[0])
        for path in sorted(root.rglob("*.py")):
            name = path.relative_to(root.parent).as_posix()
            if "/ros/" not in name:
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
