"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from emd_core.errors import InvalidInputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path in the folder of `path`; what is written there becomes `path`.

    The folder is made if need be. If the body raises, or the process dies, an older file at
    `path` stays as it was. The temporary path has the same ending.

    Raises:
        InvalidInputError: If nothing can be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(
            prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent
        )
    except OSError as err:
        raise InvalidInputError(f"cannot write {path}: {err.strerror or err}") from err
    os.close(descriptor)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Raises:
        InvalidInputError: If nothing can be written there.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def remove_unfinished(folder: Path, stem: str) -> None:
    """Delete what killed processes left of their `whole_file` with names like `stem`, a pattern.

    Nobody may be writing such a file.
    """
    for path in folder.glob(f".{stem}-*"):
        path.unlink(missing_ok=True)
