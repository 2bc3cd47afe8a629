"""Claims about shards and the reader of sequences."""

import json
from pathlib import Path

import numpy as np
import pytest

from emd_core import sequence_reader
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.sequence_reader import SequenceReader
from emd_core.sequence_shard import SequenceFailure, SequenceShard
from emd_core.voxel_grid import voxelise

FOV = FieldOfView()


def make_shard(
    indices: list[int], failed: tuple[int, ...] = (), independent: bool = False, steps: int = 2
) -> SequenceShard:
    """A shard of clouds of 50 points whose content depends on the index only."""
    rows = []
    for index in indices:
        rng = np.random.default_rng(index)
        points = rng.uniform([-0.9, -0.9, 0.0], [0.9, 0.9, 0.2], (steps + 1, 50, 3))
        picks = rng.uniform(-0.5, 0.5, (steps, 2, 2))
        picks[0, 1] = np.nan
        moves = rng.uniform(-0.5, 0.5, (steps, 2, 2))
        moves[0, 1] = np.nan
        rows.append((points.astype(np.float16), picks, moves))
    states = np.array([row[0] for row in rows], np.float16).reshape(-1, steps + 1, 50, 3)
    raised = states.astype(np.float64) + [0.0, 0.0, 0.5 * 0.003 / FOV.half_extent]
    grids = [
        [np.packbits(voxelise(FOV.table_from_normalised(s), FOV).occupancy) for s in sequence]
        for sequence in raised
    ]
    moves = np.array([row[2] for row in rows], np.float32).reshape(-1, steps, 2, 2)
    arrays = {
        "grids": np.array(grids, np.uint8).reshape(-1, steps + 1, 2048),
        "states": states,
        "picks": np.array([row[1] for row in rows], np.float32).reshape(-1, steps, 2, 2),
        "moves": moves if independent else moves[:, :, 0],
        "indices": np.array(indices, np.int64),
    }
    failures = tuple(SequenceFailure(index, 1, "torn") for index in failed)
    return SequenceShard(arrays, failures, {"cloth": {"thickness": 0.003}}, ("a",))


def test_shards_come_back_as_written(tmp_path: Path) -> None:
    """Arrays, failures, provenance and processors survive; the same content, the same bytes."""
    shard = make_shard([4, 6], failed=(5,))
    for name in ("one.npz", "two.npz"):
        shard.write(tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    again = SequenceShard.read(tmp_path / "one.npz")
    assert again.failures == shard.failures and again.meta == shard.meta
    assert again.processors == ("a",) and again.indices == {4, 5, 6}
    for name, array in shard.arrays.items():
        np.testing.assert_array_equal(again.arrays[name], array)


def test_joining_is_in_order_of_indices() -> None:
    """Parts in any order give one shard, and empty parts add only their failures."""
    parts = [make_shard([3]), make_shard([], failed=(2,)), make_shard([0, 1])]
    joined = SequenceShard.join(parts)
    assert joined.arrays["indices"].tolist() == [0, 1, 3] and joined.indices == {0, 1, 2, 3}
    np.testing.assert_array_equal(joined.arrays["states"], make_shard([0, 1, 3]).arrays["states"])
    other = SequenceShard(parts[0].arrays, (), {"seed": 1})
    for bad in ([], [parts[0], other]):
        with pytest.raises(InvalidInputError):
            SequenceShard.join(bad)


@pytest.mark.parametrize("independent", [False, True])
def test_reader_streams_what_shards_hold(tmp_path: Path, independent: bool) -> None:
    """Sequences come one by one in order with their grids, points, picks and moves."""
    make_shard([0, 1], (2,), independent).write(tmp_path / "shard_00000.npz")
    make_shard([3], (), independent).write(tmp_path / "shard_00001.npz")
    reader = SequenceReader([tmp_path])
    assert len(reader) == 3 and reader.lengths.tolist() == [2, 2, 2]
    assert [failure.index for failure in reader.failures] == [2]
    wanted = make_shard([0, 1, 3], (), independent).arrays
    for row, sequence in enumerate(reader):
        assert sequence.index == wanted["indices"][row] and sequence.independent == independent
        np.testing.assert_array_equal(sequence.states, wanted["states"][row])
        np.testing.assert_array_equal(sequence.picks, wanted["picks"][row])
        np.testing.assert_array_equal(sequence.moves, wanted["moves"][row])
        for grid, points in zip(sequence.grids, sequence.upper_surface, strict=True):
            table = FOV.table_from_normalised(points)
            assert (voxelise(table).occupancy != grid).sum() <= 2  # float32 at voxels' sides


def test_only_one_sequence_is_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader opens a file when it comes to it and reads rows as they are asked for."""
    for number in range(3):
        make_shard([2 * number, 2 * number + 1]).write(tmp_path / f"shard_{number:05d}.npz")
    reader = SequenceReader([tmp_path])
    rows = []
    real = sequence_reader.NpzReader.rows

    def counted(self, name):
        for row in real(self, name):
            rows.append(name)
            yield row

    monkeypatch.setattr(sequence_reader.NpzReader, "rows", counted)
    sequences = iter(reader)
    for count in range(1, 7):
        next(sequences)
        assert rows.count("states") == count


def test_authors_files_get_grids_of_their_vertices(tmp_path: Path) -> None:
    """A file without grids or provenance is voxelised as it is."""
    arrays = make_shard([1]).arrays
    np.savez(tmp_path / "a.npz", **{k: arrays[k] for k in ("states", "picks", "moves")})
    (sequence,) = SequenceReader([tmp_path])
    for grid, points in zip(sequence.grids, sequence.states, strict=True):
        wanted = voxelise(FOV.table_from_normalised(points)).occupancy
        np.testing.assert_array_equal(grid, wanted)
    assert sequence.surface_height == 0.0


def test_earlier_format_is_read(tmp_path: Path) -> None:
    """Shards of format 1 with their dictionary of failures still read."""
    shard = make_shard([0])
    meta = {"cloth": {"thickness": 0.003}, "failures": {"1": "step 2: torn"}}
    arrays = {name: shard.arrays[name] for name in ("grids", "states", "picks", "moves")}
    np.savez(tmp_path / "shard_00000.npz", **arrays, seeds=[0], meta=json.dumps(meta))
    reader = SequenceReader([tmp_path])
    assert reader.failures == [SequenceFailure(1, 2, "torn")] and len(list(reader)) == 1


def test_newer_format_is_refused(tmp_path: Path) -> None:
    """A shard of a format to come is not guessed at."""
    shard = make_shard([0])
    newer = SequenceShard(shard.arrays, (), {**shard.meta, "format": 99})
    newer.write(tmp_path / "shard_00000.npz")
    with pytest.raises(InvalidInputError, match="newer"):
        SequenceReader([tmp_path])


def test_damaged_shard_is_named(tmp_path: Path) -> None:
    """A shard cut short is refused with its name, by the reader and as a whole."""
    path = tmp_path / "shard_00000.npz"
    make_shard([0]).write(path)
    path.write_bytes(path.read_bytes()[:-200])
    for read in (lambda: SequenceReader([tmp_path]), lambda: SequenceShard.read(path)):
        with pytest.raises(InvalidInputError, match="shard_00000.npz"):
            read()


def test_values_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    """NaN vertices and a used hand without a displacement are named with their file."""
    for name, spoil in (("states", (0, 1, 3, 2)), ("moves", (0, 1, 1, 0))):
        shard = make_shard([0], independent=True)
        shard.arrays[name][spoil] = np.nan
        shard.write(tmp_path / "shard_00000.npz")
        with pytest.raises(InvalidInputError, match="finite"):
            list(SequenceReader([tmp_path]))
