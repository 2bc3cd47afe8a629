"""The folder that a data set grows in, whatever happens to those who write to it.

    generation.json               what is asked for, and the provenance of all sequences
    shard_00000.npz ...           finished shards
    partial/sequence_0000007.npz  sequences of shards that are not finished

Each file appears whole or not at all. A sequence counts once its partial file is there; when all
of a shard are, the shard is written and its partial files go. So a kill between any two
operations loses at most the sequences under way, and what is left over is put right at the next
start.
"""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from emd_cloth_sim.generation_config import GenerationConfig, provenance
from emd_core.errors import BusyError, InvalidInputError
from emd_core.sequence_shard import SequenceFailure, SequenceShard
from emd_core.whole_file import remove_unfinished, write_text

SETTINGS = "generation.json"
PARTIAL = "partial"


class GenerationFolder:
    """A folder that one process at a time writes to; use it as a context.

    Attributes:
        done: Indices of the sequences that are there, failed ones too.
        failures: Those among them that failed.
    """

    def __init__(self, path: Path, config: GenerationConfig) -> None:
        """Say which folder and which data set; nothing is touched yet."""
        self.path = path
        self.config = config
        self.done: set[int] = set()
        self.failures: list[SequenceFailure] = []
        self._provenance = provenance(config)
        self._lock = -1

    def __enter__(self) -> GenerationFolder:
        """Lock the folder and find what is there.

        Raises:
            BusyError: If another process writes to it.
            InvalidInputError: If it belongs to another data set or a file cannot be read.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            # The lock is the folder's own, so it leaves no file, and a kill releases it.
            self._lock = os.open(self.path, os.O_RDONLY)
        except OSError as err:
            raise InvalidInputError(
                f"{self.path} should be a folder to generate into: {err}; name another"
            ) from err
        try:
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as err:
                raise BusyError(
                    f"another process generates into {self.path}; wait for it, or use another "
                    "folder"
                ) from err
            self._check_settings()
            self._take_stock()
        except BaseException:
            os.close(self._lock)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        """Release the folder."""
        os.close(self._lock)

    @property
    def missing(self) -> list[int]:
        """Indices of the sequences still to be simulated, in order."""
        return [index for index in range(self.config.sequences) if index not in self.done]

    def add(self, part: SequenceShard) -> None:
        """Keep a sequence, and its shard when this was the last one missing.

        Raises:
            InvalidInputError: If its provenance is not this data set's.
        """
        self._check_provenance(part, "a worker's sequence")
        (index,) = part.indices
        part.write(self._partial_path(index))
        self._note(part)
        self._finish_shard(index // self.config.shard_size)

    def shard_path(self, shard: int) -> Path:
        """Name of a shard's file."""
        return self.path / f"shard_{shard:05d}.npz"

    def _partial_path(self, index: int) -> Path:
        return self.path / PARTIAL / f"sequence_{index:07d}.npz"

    def _check_settings(self) -> None:
        """Compare `generation.json` with what is asked for; write it if that is new or more."""
        path = self.path / SETTINGS
        wanted: dict[str, Any] = {
            "sequences": self.config.sequences,
            "shard_size": self.config.shard_size,
            **self._provenance,
        }
        found = _read_settings(path)
        if found is None and any(self.path.glob("[!.]*.npz")):
            raise InvalidInputError(
                f"{self.path} holds .npz files but no {SETTINGS}; use an empty folder"
            )
        if found is not None:
            asked = found.get("sequences", 0)
            if asked > self.config.sequences:
                raise InvalidInputError(
                    f"{self.path} was begun with {asked} sequences, so at least as many must be "
                    f"asked for, got {self.config.sequences}"
                )
            found["sequences"] = self.config.sequences
            differing = _differences(found, wanted)
            if differing:
                raise InvalidInputError(
                    f"{self.path} was begun with other settings ({'; '.join(differing)}); use the "
                    "same again, or another folder"
                )
            if asked == self.config.sequences:
                return
        write_text(path, json.dumps(wanted, indent=1, sort_keys=True) + "\n")

    def _take_stock(self) -> None:
        """Find what is there and put right what a kill left behind."""
        for folder, stem in (
            (self.path, "generation"),
            (self.path, "shard_*"),
            (self.path / PARTIAL, "sequence_*"),
        ):
            remove_unfinished(folder, stem)
        for path in sorted(self.path.glob("shard_*.npz")):
            shard = SequenceShard.read(path, ("indices",))
            self._check_provenance(shard, str(path))
            self._note(shard)
        waiting = set()
        for path in sorted((self.path / PARTIAL).glob("sequence_*.npz")):
            part = SequenceShard.read(path, ("indices",))
            self._check_provenance(part, str(path))
            if part.indices <= self.done:
                path.unlink()  # its shard was written, then came the kill
                continue
            self._note(part)
            waiting |= {index // self.config.shard_size for index in part.indices}
        for number in sorted(waiting):
            self._finish_shard(number)
        self._remove_empty()

    def _finish_shard(self, number: int) -> None:
        """Write a shard if all of its sequences are there, then remove the partial files."""
        members = self.config.members(number)
        if not self.done.issuperset(members):
            return
        paths = [path for index in members if (path := self._partial_path(index)).exists()]
        parts = [SequenceShard.read(path) for path in paths]
        if self.shard_path(number).exists():  # a shorter one, when fewer sequences were asked for
            parts.append(SequenceShard.read(self.shard_path(number)))
        SequenceShard.join(parts).write(self.shard_path(number))
        for path in paths:
            path.unlink()
        self._remove_empty()

    def _remove_empty(self) -> None:
        partial = self.path / PARTIAL
        if partial.is_dir() and not any(partial.iterdir()):
            partial.rmdir()

    def _note(self, shard: SequenceShard) -> None:
        self.done |= shard.indices
        self.failures += shard.failures

    def _check_provenance(self, shard: SequenceShard, what: str) -> None:
        differing = _differences(dict(shard.meta), self._provenance)
        if differing:
            raise InvalidInputError(
                f"{what} was made with other settings or another program ({'; '.join(differing)});"
                " use the same everywhere, or another folder"
            )


def _read_settings(path: Path) -> dict[str, Any] | None:
    if not path.exists():
        return None
    try:
        found = json.loads(path.read_text())
        if not isinstance(found, dict):
            raise ValueError("not an object")
    except (OSError, ValueError) as err:
        raise InvalidInputError(
            f"{path} should be what the generator wrote but cannot be read: {err}; use another "
            "folder"
        ) from err
    return found


def _differences(found: dict[str, Any], wanted: dict[str, Any]) -> list[str]:
    """Name what differs, one text for each setting."""
    return [
        f"{name}: {found.get(name)} there, {wanted.get(name)} here"
        for name in sorted(found.keys() | wanted.keys())
        if found.get(name) != wanted.get(name)
    ]
