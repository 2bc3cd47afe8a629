"""Claims about archives that are written bit by bit and read row by row."""

import tempfile
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from emd_core.npz_stream import READ_ERRORS, NpzReader, StreamedArray, save_npz
from emd_core.whole_file import remove_unfinished

TYPES = st.sampled_from([np.uint8, np.float16, np.float32, np.int64, np.bool_])


def stored(content: dict) -> BytesIO:
    """An archive in memory."""
    with tempfile.TemporaryDirectory() as folder:
        save_npz(Path(folder) / "a.npz", content)
        return BytesIO((Path(folder) / "a.npz").read_bytes())


@given(array=TYPES.flatmap(lambda kind: arrays(kind, array_shapes(max_dims=4))))
def test_what_is_written_is_read(array: np.ndarray) -> None:
    """numpy.load, whole arrays and rows all give what was written, whatever its type."""
    stream = stored({"a": array, "text": np.array("grüße")})
    with np.load(stream, allow_pickle=False) as loaded:
        np.testing.assert_array_equal(loaded["a"], array)
        assert str(loaded["text"]) == "grüße"
    with NpzReader(stream) as reader:  # type: ignore[arg-type]
        assert reader.shape("a") == array.shape and reader.dtype("a") == array.dtype
        np.testing.assert_array_equal(reader.array("a"), array)
        np.testing.assert_array_equal(list(reader.rows("a")), array)


def test_bytes_do_not_depend_on_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same arrays give the same bytes in another year."""
    content = {"a": np.arange(1000), "b": np.zeros((3, 0))}
    first = stored(content).getvalue()
    monkeypatch.setattr("time.time", lambda: 2e9)
    monkeypatch.setattr("time.localtime", lambda *_: (2033, 5, 18, 3, 33, 20, 2, 138, 0))
    assert stored(content).getvalue() == first
    dates = {entry.date_time for entry in zipfile.ZipFile(BytesIO(first)).infolist()}
    assert dates == {(1980, 1, 1, 0, 0, 0)}


def test_streamed_array_equals_a_whole_one() -> None:
    """An array that comes in parts is stored as if whole; a missing part is noticed."""
    array = np.random.default_rng(0).random((7, 3, 2)).astype(np.float32)
    parts = StreamedArray(array.shape, array.dtype, np.split(array, [2, 3]))
    with np.load(stored({"a": parts})) as loaded:
        np.testing.assert_array_equal(loaded["a"], array)
    with pytest.raises(ValueError, match="7 rows"):
        stored({"a": StreamedArray(array.shape, array.dtype, [array[:5]])})


def test_rows_are_read_one_at_a_time(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Reading the first row of a big array does not read the others."""
    path = tmp_path / "big.npz"
    save_npz(path, {"a": np.random.default_rng(0).integers(0, 256, (200, 10000), np.uint8)})
    read = []
    real = zipfile.ZipExtFile.read
    monkeypatch.setattr(
        zipfile.ZipExtFile, "read", lambda self, n=-1: read.append(n) or real(self, n)
    )
    with NpzReader(path) as reader:
        rows = reader.rows("a")
        next(rows)
        rows.close()
    assert max(read) <= 10000 and sum(read) < 30000


def test_column_order_and_objects(tmp_path: Path) -> None:
    """Arrays stored column by column read right; Python objects are refused, not unpickled."""
    array = np.asfortranarray(np.arange(12.0).reshape(3, 4))
    np.savez(tmp_path / "f.npz", a=array)
    with NpzReader(tmp_path / "f.npz") as reader:
        np.testing.assert_array_equal(list(reader.rows("a")), array)
    np.savez(tmp_path / "o.npz", a=np.array([{}], dtype=object))
    with NpzReader(tmp_path / "o.npz") as reader, pytest.raises(READ_ERRORS):
        list(reader.rows("a"))


def test_damaged_archive_is_noticed(tmp_path: Path) -> None:
    """A flipped byte or a lost end never reads as data."""
    data = stored({"a": np.random.default_rng(0).random(5000)}).getvalue()
    for damaged in (data[: len(data) // 2], data[:3000] + bytes([data[3000] ^ 255]) + data[3001:]):
        path = tmp_path / "damaged.npz"
        path.write_bytes(damaged)
        with pytest.raises(READ_ERRORS), NpzReader(path) as reader:
            list(reader.rows("a"))
            reader.array("a")


def test_leftovers_of_a_kill_are_removed(tmp_path: Path) -> None:
    """Half-written shards go, finished ones and what others write stay."""
    for name in (".shard_00000-abc.npz", "shard_00000.npz", ".notes-abc.npz"):
        (tmp_path / name).write_bytes(b"")
    remove_unfinished(tmp_path, "shard_*")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        ".notes-abc.npz",
        "shard_00000.npz",
    ]
