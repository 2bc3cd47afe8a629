"""Archives of arrays (.npz) that are the same for the same arrays, and that are read row by row.

`numpy.load` reads them too. A large array of an archive is never held as a whole: a row is what
one index along the first axis gives.
"""

from __future__ import annotations

import math
import os
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from emd_core.whole_file import whole_file

READ_ERRORS = (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile, zlib.error)
"""What a missing, broken or foreign archive raises when it is read."""


@dataclass(frozen=True)
class StreamedArray:
    """An array that is written without ever being whole.

    Attributes:
        shape: Of the whole array.
        dtype: Of its values.
        parts: Arrays that follow each other along the first axis.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    parts: Iterable[NDArray[Any]]


def save_npz(path: Path, arrays: Mapping[str, NDArray[Any] | StreamedArray]) -> None:
    """Write a compressed archive, whole or not at all, on the disk when this returns.

    Its bytes depend on the arrays and their order only: `numpy.savez_compressed` leaves the
    entries' dates to the zip library, here they are fixed.

    Raises:
        InvalidInputError: If nothing can be written there.
    """
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        _write(stream, arrays)
        stream.flush()
        os.fsync(stream.fileno())


def _write(stream: BinaryIO, arrays: Mapping[str, NDArray[Any] | StreamedArray]) -> None:
    with zipfile.ZipFile(stream, "w") as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            with archive.open(entry, "w", force_zip64=True) as target:
                if isinstance(array, StreamedArray):
                    _write_parts(target, array)
                else:
                    npy.write_array(target, np.asarray(array, order="C"), allow_pickle=False)


class NpzReader:
    """An archive that is read array by array or row by row; use it as a context.

    Raises one of `READ_ERRORS` when the file is not what it should be.
    """

    def __init__(self, path: Path) -> None:
        """Open the archive."""
        self._archive = zipfile.ZipFile(path)
        names = self._archive.namelist()
        self.names = {name.removesuffix(".npy") for name in names if name.endswith(".npy")}

    def __enter__(self) -> NpzReader:
        """Give the reader."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._archive.close()

    def __contains__(self, name: str) -> bool:
        """Whether the archive holds an array of this name."""
        return name in self.names

    def shape(self, name: str) -> tuple[int, ...]:
        """Give an array's shape without reading it."""
        return self._open(name)[0]

    def dtype(self, name: str) -> np.dtype[Any]:
        """Give an array's type without reading it."""
        return self._open(name)[1]

    def array(self, name: str) -> NDArray[Any]:
        """Read a whole array."""
        with self._archive.open(f"{name}.npy") as source:
            return np.asarray(npy.read_array(source, allow_pickle=False))

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Read an array row by row."""
        shape, dtype, by_columns, source = self._open(name)
        with source:
            if by_columns:
                yield from self.array(name)
                return
            size = math.prod(shape[1:]) * dtype.itemsize
            for _ in range(shape[0]):
                data = source.read(size)
                if len(data) != size:
                    raise ValueError(f"{name} ends early")
                yield np.frombuffer(data, dtype).reshape(shape[1:])

    def _open(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any], bool, IO[bytes]]:
        """Open an array behind its header: shape, type, whether in column order, data."""
        source = self._archive.open(f"{name}.npy")
        version = npy.read_magic(source)
        if version == (1, 0):
            shape, by_columns, dtype = npy.read_array_header_1_0(source)
        else:
            shape, by_columns, dtype = npy.read_array_header_2_0(source)
        if dtype.hasobject:
            raise ValueError(f"{name} holds Python objects")
        return shape, dtype, by_columns, source


def _write_parts(target: IO[bytes], array: StreamedArray) -> None:
    header = {
        "descr": npy.dtype_to_descr(array.dtype),
        "fortran_order": False,
        "shape": array.shape,
    }
    npy.write_array_header_1_0(target, header)
    rows = 0
    for part in array.parts:
        rows += len(part)
        target.write(np.ascontiguousarray(part, dtype=array.dtype).tobytes())
    if rows != array.shape[0]:
        raise ValueError(f"{array.shape[0]} rows were announced, {rows} came")
