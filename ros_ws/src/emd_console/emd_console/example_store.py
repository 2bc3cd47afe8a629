"""A folder of recorded examples, each whole or absent, with what reviewers say of them."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from emd_console.example import ENTRY, SHARD, Example
from emd_console.motion import MOTION
from emd_core.errors import BusyError, InvalidInputError
from emd_core.sequence_shard import SequenceShard
from emd_core.whole_file import write_text

UNDECIDED, ACCEPTED, REJECTED = "undecided", "accepted", "rejected"
VERDICTS = (UNDECIDED, ACCEPTED, REJECTED)
_NAME = re.compile(r"example_(\d{5,})")
_PARTIAL = ".partial-"
_REVIEW = "review.json"
_LONGEST_NOTE = 500
_PER_SHARD = 16
_MOST = 10**9  # examples


@dataclass(frozen=True)
class Review:
    """What a reviewer says of an example.

    Attributes:
        verdict: undecided, accepted or rejected.
        note: Free text.
        who: Who said so last.
    """

    verdict: str = UNDECIDED
    note: str = ""
    who: str = ""


@dataclass(frozen=True)
class StoredExample:
    """An example on disk.

    Attributes:
        number: Its index.
        folder: Where its files are; a data set of one sequence.
        entry: What example.json holds.
        review: What was said of it.
    """

    number: int
    folder: Path
    entry: dict[str, Any]
    review: Review


class ExampleStore:
    """Adds examples and reviews to a folder; one program at a time.

    Attributes:
        root: The folder.
        opened: When, ISO 8601, UTC; examples tell it as their run.
    """

    def __init__(self, root: Path) -> None:
        """Open a folder, made if need be, and clear away what a killed program left unfinished.

        Raises:
            BusyError: If another program records there.
            InvalidInputError: If nothing can be written there.
        """
        self.root = root
        self.opened = datetime.now(UTC).isoformat(timespec="milliseconds")
        try:
            root.mkdir(parents=True, exist_ok=True)
            self._lock = open(root / ".lock", "w")  # noqa: SIM115  (held as long as the store)
        except OSError as err:
            raise InvalidInputError(f"cannot record in {root}: {err.strerror or err}") from err
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as err:
            self._lock.close()
            raise BusyError(f"another console records in {root}; name another folder") from err
        for left in root.glob(f"{_PARTIAL}*"):
            shutil.rmtree(left)

    def close(self) -> None:
        """Let another program record there."""
        self._lock.close()

    def add(self, example: Example) -> StoredExample:
        """Write an example; its folder appears when it is whole.

        Raises:
            InvalidInputError: If it cannot be written.
        """
        number = max(_numbers(self.root), default=-1) + 1
        partial = self.root / f"{_PARTIAL}{number:05d}"
        folder = _folder(self.root, number)
        try:
            partial.mkdir()
            now = datetime.now(UTC).isoformat(timespec="seconds")
            example.write(partial, number, now, self.opened)
            _flush(partial)
            partial.rename(folder)
        except OSError as err:
            shutil.rmtree(partial, ignore_errors=True)
            raise InvalidInputError(f"cannot record {folder}: {err.strerror or err}") from err
        return self.get(number)

    def all(self) -> list[StoredExample]:
        """Every example, the newest first."""
        return [self.get(number) for number in sorted(_numbers(self.root), reverse=True)]

    def get(self, number: int) -> StoredExample:
        """Read an example's record.

        Raises:
            InvalidInputError: If there is none of that number, or it cannot be read.
        """
        return _read(self.root, number)

    def review(self, number: int, review: Review) -> None:
        """Say what an example is worth.

        Raises:
            InvalidInputError: If there is none of that number, the verdict is unknown or the note
                too long.
        """
        if review.verdict not in VERDICTS:
            raise InvalidInputError(
                f"a verdict must be one of {', '.join(VERDICTS)}, got {review.verdict!r}"
            )
        if len(review.note) > _LONGEST_NOTE:
            raise InvalidInputError(
                f"a note of at most {_LONGEST_NOTE} characters is wanted, got {len(review.note)}"
            )
        write_text(self.get(number).folder / _REVIEW, json.dumps(asdict(review), indent=1))

    def picture(self, number: int, moment: str) -> bytes | None:
        """A JPEG of `before` or `after`; None if there is none."""
        if moment not in ("before", "after") or not 0 <= number < _MOST:
            return None
        file = _folder(self.root, number) / f"{moment}.jpg"
        return file.read_bytes() if file.is_file() else None

    def motion(self, number: int) -> Path | None:
        """The bag of a recording's motion, a folder; None if there is none."""
        folder = _folder(self.root, number) / MOTION
        return folder if 0 <= number < _MOST and folder.is_dir() else None


def stored_examples(root: Path) -> list[StoredExample]:
    """Read a store's examples, the oldest first, also while a console records there."""
    return [_read(root, number) for number in sorted(_numbers(root))] if root.is_dir() else []


def export_examples(root: Path, out: Path, verdict: str = ACCEPTED, motions: bool = False) -> int:
    """Write a store's examples of one verdict as a data set, also while a console records there.

    Args:
        root: The store.
        out: A new folder.
        verdict: Which ones to write.
        motions: Whether to copy the bags of their motions, too, into `out/motions`.

    Raises:
        InvalidInputError: If there is none, or `out` is not empty.
    """
    chosen = [item for item in stored_examples(root) if item.review.verdict == verdict]
    if not chosen:
        raise InvalidInputError(
            f"{root} holds no example that is {verdict}; record and review some on the console"
        )
    if out.exists() and any(out.iterdir()):
        raise InvalidInputError(f"{out} is not empty; name a new folder")
    for shard, start in enumerate(range(0, len(chosen), _PER_SHARD)):
        parts = chosen[start : start + _PER_SHARD]
        joined = SequenceShard.join([SequenceShard.read(item.folder / SHARD) for item in parts])
        joined.write(out / f"shard_{shard:05d}.npz")
    for item in chosen if motions else ():
        if (bag := item.folder / MOTION).is_dir():
            shutil.copytree(bag, out / "motions" / item.folder.name)
    return len(chosen)


def _folder(root: Path, number: int) -> Path:
    return root / f"example_{number:05d}"


def _numbers(root: Path) -> list[int]:
    found = (_NAME.fullmatch(path.name) for path in root.iterdir())
    return [int(match[1]) for match in found if match]


def _read(root: Path, number: int) -> StoredExample:
    folder = _folder(root, number)
    try:
        entry = json.loads((folder / ENTRY).read_text())
    except (OSError, ValueError) as err:
        raise InvalidInputError(f"there is no example {number} in {root}") from err
    return StoredExample(number, folder, entry, _review(folder))


def _review(folder: Path) -> Review:
    try:
        stored = json.loads((folder / _REVIEW).read_text())
        return Review(**{name: str(stored[name]) for name in ("verdict", "note", "who")})
    except (OSError, ValueError, KeyError, TypeError):
        return Review()


def _flush(folder: Path) -> None:
    """Bring the files to the disk before their folder gets its name."""
    for file in (path for path in folder.rglob("*") if path.is_file()):
        descriptor = os.open(file, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
