"""`./cell train`: the second phase, on what the console recorded."""

import json

import numpy as np
import pytest
from fake_cell import example
from typer.testing import CliRunner

from emd_cell.cli import app
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_console.example_store import ACCEPTED, ExampleStore, Review, export_examples
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise
from emd_planner.architectures import ARCHITECTURES
from emd_planner.net_config import SpatialNetConfig


@pytest.fixture
def simulated(tmp_path):
    """Twenty sequences of a flat cloth of which nobody moves anything, with vertices."""
    cloth = ClothConfig()
    points = flat_positions(cloth.vertices, cloth.side_lengths)
    grid = np.packbits(voxelise(points).occupancy)
    folder = tmp_path / "simulated"
    folder.mkdir()
    np.savez(
        folder / "shard_00000.npz",
        grids=np.tile(grid, (20, 2, 1)),
        states=np.tile(points / FieldOfView().half_extent, (20, 2, 1, 1)).astype(np.float16),
        picks=np.full((20, 1, 2, 2), 0.3),
        moves=np.zeros((20, 1, 2)),
        meta=json.dumps({"cloth": {"thickness": 0.003}}),
    )
    return folder


@pytest.fixture
def recorded(tmp_path):
    """Twelve accepted manipulations as the console exports them, without vertices."""
    store = ExampleStore(tmp_path / "console" / "examples")
    for number in range(12):
        store.add(example())
        store.review(number, Review(ACCEPTED))
    store.close()
    export_examples(store.root, tmp_path / "recorded")
    return tmp_path / "recorded"


def run(*options):
    """Call the command."""
    return CliRunner().invoke(app, ["train", *map(str, options)])


def test_recordings_are_mixed_with_simulated_data(simulated, recorded, tmp_path, monkeypatch):
    """With free turns and near misses left on; the weights tell what was mixed in."""
    small = SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1)
    monkeypatch.setitem(ARCHITECTURES, "spatial", lambda: small)
    out = tmp_path / "net"
    options = ("--out", out, "--iterations", 2, "--batch-size", 6, "--device", "cpu")
    result = run("--data", simulated, "--mix", recorded, "--mix-share", 0.5, *options)
    assert result.exit_code == 0, result.output
    assert "mixed in" in result.output and "without vertices" in result.output
    told = json.loads((out / "emd_net.json").read_text())
    assert told["iterations"] == 2 and told["mixed_in"] >= 8
    again = run("--data", simulated, *options)
    assert again.exit_code == 1 and "another data" in " ".join(again.output.split())


def test_help_and_mistakes_are_the_trainers_own(tmp_path):
    """Options go through as they are."""
    assert "usage: ./cell train" in run("--help").output
    result = run("--data", tmp_path / "absent", "--out", tmp_path, "--iterations", 1)
    assert result.exit_code == 1 and "found none" in " ".join(result.output.split())
