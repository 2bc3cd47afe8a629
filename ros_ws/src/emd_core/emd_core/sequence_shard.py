"""Shards: files that hold cloth sequences; `docs/data_format.md` describes them.

A shard is an .npz of N sequences of L manipulations each:

- `grids` uint8 (N, L + 1, B): `numpy.packbits` of the boolean grids in C order;
- `picks` float32 (N, L, 2, 2): grasp points, normalised, an unused hand NaN;
- `moves` float32 (N, L, 2): displacement of both hands, normalised; (N, L, 2, 2) if each hand
  has one of its own, NaN for an unused hand;
- `states` float16 (N, L + 1, V, 3): normalised vertices of the mid-surface, row by row;
- `indices` int64 (N,): number of the sequence in the whole data set;
- perhaps `crossings` int16 (N, L), `settled` bool (N, L) and `attempts` uint8 (N, L): the
  simulation's own doubts;
- `meta`: a JSON object as a string: `format`, provenance, `failures`, `processors`.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.npz_stream import READ_ERRORS, NpzReader, save_npz

FORMAT = 2
PATTERN = "shard_*.npz"


@dataclass(frozen=True)
class SequenceFailure:
    """A sequence that the data lack, and why.

    Attributes:
        index: Its number in the whole data set.
        step: Manipulation that failed, from 0; -1: one before the recorded start.
        reason: What was wrong.
    """

    index: int
    step: int
    reason: str


@dataclass(frozen=True)
class SequenceShard:
    """Sequences of one length and one mesh, as a file holds them.

    Attributes:
        arrays: See the module's docstring; the first axis is the sequence.
        failures: Sequences of this shard that failed.
        meta: Provenance that all sequences share, as JSON holds it.
        processors: Kinds of processors that simulated them: other ones may round differently.
    """

    arrays: Mapping[str, NDArray[Any]]
    failures: tuple[SequenceFailure, ...]
    meta: Mapping[str, Any]
    processors: tuple[str, ...] = ()

    @property
    def indices(self) -> set[int]:
        """Numbers of all sequences that were tried, failed ones too."""
        return set(self.arrays["indices"].tolist()) | {entry.index for entry in self.failures}

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all; the same content gives the same bytes.

        Raises:
            InvalidInputError: If nothing can be written there.
        """
        meta = {
            "format": FORMAT,
            **self.meta,
            "failures": [asdict(entry) for entry in self.failures],
            "processors": list(self.processors),
        }
        save_npz(path, {**self.arrays, "meta": np.array(json.dumps(meta, sort_keys=True))})

    @classmethod
    def read(cls, path: Path, names: Collection[str] | None = None) -> SequenceShard:
        """Read a file into memory.

        Args:
            path: The file.
            names: Arrays to read; all if None.

        Raises:
            InvalidInputError: If it cannot be read or is no shard of this format.
        """
        try:
            with NpzReader(path) as stored:
                meta = read_meta(stored)
                wanted = names or sorted((stored.names | {"indices"}) - {"meta"})
                arrays = {name: stored.array(name) for name in wanted}
        except READ_ERRORS as err:
            raise InvalidInputError(
                f"{path} should be a shard of format {FORMAT} but cannot be read: {err}; "
                "delete it, and make it again"
            ) from err
        failures = failures_of(meta)
        processors = tuple(meta.pop("processors", ()))
        for name in ("format", "failures"):
            meta.pop(name, None)
        return cls(arrays, failures, meta, processors)

    @classmethod
    def join(cls, shards: Iterable[SequenceShard]) -> SequenceShard:
        """Put shards of one provenance together, in the order of the sequences' indices.

        Raises:
            InvalidInputError: If there is none, or their provenances or arrays differ.
        """
        parts = list(shards)
        if not parts:
            raise InvalidInputError("at least one shard is needed to join, got none")
        first = parts[0]
        for part in parts:
            if part.meta != first.meta or part.arrays.keys() != first.arrays.keys():
                raise InvalidInputError("shards to join must have one provenance, got several")
        order = np.argsort(np.concatenate([part.arrays["indices"] for part in parts]))
        arrays = {
            name: np.concatenate([part.arrays[name] for part in parts])[order]
            for name in sorted(first.arrays)
        }
        failures = [entry for part in parts for entry in part.failures]
        processors = sorted({name for part in parts for name in part.processors})
        return cls(
            arrays,
            tuple(sorted(failures, key=lambda entry: entry.index)),
            first.meta,
            tuple(processors),
        )


def read_meta(stored: NpzReader) -> dict[str, Any]:
    """Give a file's provenance; empty if it holds none.

    Raises:
        ValueError: If it is no JSON object, or of a newer format than this program knows.
    """
    if "meta" not in stored:
        return {}
    meta = json.loads(str(stored.array("meta")))
    if not isinstance(meta, dict):
        raise ValueError("meta must be a JSON object")
    if meta.get("format", FORMAT) > FORMAT:
        raise ValueError(f"format {meta['format']} is newer than {FORMAT}, update the program")
    return meta


def failures_of(meta: Mapping[str, Any]) -> tuple[SequenceFailure, ...]:
    """Give the failures that a file's provenance lists."""
    entries = meta.get("failures", [])
    if isinstance(entries, dict):  # format 1 had {"index": "step N: reason"}
        texts = [(index, *text.partition(": ")[::2]) for index, text in entries.items()]
        return tuple(
            SequenceFailure(int(index), int(step.split()[-1]), reason)
            for index, step, reason in texts
        )
    return tuple(SequenceFailure(**entry) for entry in entries)
