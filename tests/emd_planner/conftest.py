"""Small nets and made-up cloth for the planner's tests."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise
from emd_planner.net_config import EmdNetConfig


@pytest.fixture(autouse=True)
def one_thread():
    """Keep the tests to one core and their results independent of the number of cores."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def small_config():
    """Few maps and layers, but grids of the true size."""
    return EmdNetConfig(map_counts=(1, 4, 8, 8, 16, 16, 32), manipulation_layers=4, hidden_size=32)


def _rectangle(
    centre: tuple[float, float] = (0.0, 0.0),
    size: tuple[float, float] = (1.4, 1.4),
    height: float = 0.02,
    spacing: float = 0.02,
) -> np.ndarray:
    """Points of a flat rectangle in normalised units, shape (N, 3)."""
    x = np.arange(-size[0] / 2, size[0] / 2 + 1e-9, spacing) + centre[0]
    y = np.arange(-size[1] / 2, size[1] / 2 + 1e-9, spacing) + centre[1]
    plane = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    return np.column_stack([plane, np.full(len(plane), height)])


def _grid_of(points: np.ndarray):
    """Voxelise normalised points."""
    return voxelise(points * FieldOfView().half_extent)


@pytest.fixture
def shard_directory(tmp_path):
    """Two shards of made-up sequences: a patch of cloth carried about, some with one hand."""
    _write_shards(tmp_path / "data", sequences=12)
    return tmp_path / "data"


def _write_shards(directory, sequences: int, length: int = 3, seed: int = 0) -> None:
    """Write sequences in which the whole patch follows the hands."""
    directory.mkdir(parents=True, exist_ok=True)
    generator = np.random.default_rng(seed)
    grids, picks, moves = [], [], []
    for _ in range(sequences):
        centre = generator.uniform(-0.2, 0.2, 2)
        row = [_grid_of(_rectangle(tuple(centre), (0.8, 0.5))).occupancy]
        row_picks = generator.uniform(-0.2, 0.2, (length, 2, 2)).astype(np.float32)
        row_picks[generator.random(length) < 0.5, 1] = np.nan
        row_moves = generator.uniform(-0.3, 0.3, (length, 2)).astype(np.float32)
        for move in row_moves:
            centre = centre + move
            row.append(_grid_of(_rectangle(tuple(centre), (0.8, 0.5))).occupancy)
        grids.append(np.packbits(np.array(row).reshape(length + 1, -1), axis=-1))
        picks.append(row_picks)
        moves.append(row_moves)
    half = sequences // 2
    for index, part in enumerate((slice(0, half), slice(half, None))):
        np.savez_compressed(
            directory / f"shard_{index:04d}.npz",
            grids=np.array(grids[part]),
            picks=np.array(picks[part]),
            moves=np.array(moves[part]),
            seeds=np.arange(sequences)[part],
            meta='{"made": "by the tests"}',
        )


@pytest.fixture
def rectangle():
    """Make points of a flat rectangle."""
    return _rectangle


@pytest.fixture
def grid_of():
    """Voxelise normalised points."""
    return _grid_of


@pytest.fixture
def write_shards():
    """Write shards of made-up sequences to a directory."""
    return _write_shards
