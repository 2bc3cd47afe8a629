"""Training by several processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.net_config import SpatialNetConfig
from emd_planner.process_group import ProcessGroup, join_processes
from emd_planner.sequence_files import load_sequences
from emd_planner.trainer import Run, Trainer
from emd_planner.training_config import AugmentationConfig, TrainingConfig
from emd_planner.weights import load_net, read_provenance

AVERAGES = """
import torch
from emd_planner.process_group import join_processes
group = join_processes(torch.device("cpu"))
tensors = [torch.full((2, 3), float(group.rank)), torch.tensor([10.0 * group.rank])]
group.average(tensors)
assert group.size == 2 and group.leads == (group.rank == 0)
assert (tensors[0] == 0.5).all() and float(tensors[1]) == 5.0, tensors
assert group.of_leader(group.rank + 7.25) == 7.25
group.leave()
"""
TRAINS = """
import sys
from emd_planner import train
from emd_planner.architectures import ARCHITECTURES
from emd_planner.net_config import SpatialNetConfig
ARCHITECTURES["spatial"] = lambda: SpatialNetConfig(
    widths=(4, 4, 4), moved_width=2, coarse_blocks=1
)
sys.exit(train.main(sys.argv[1:]))
"""


def _torchrun(script: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a script in two processes."""
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    command += ["--nproc-per-node", "2", str(script), *arguments]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)


def test_tensors_are_averaged_over_processes(tmp_path: Path) -> None:
    """And what the leader says is heard by all."""
    script = tmp_path / "averages.py"
    script.write_text(AVERAGES)
    done = _torchrun(script)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_two_processes_train_one_net(shard_directory: Path, tmp_path: Path) -> None:
    """Twice the same weights, other ones than one process makes, and one checkpoint."""
    script, weights = tmp_path / "trains.py", []
    script.write_text(TRAINS)
    for name in ("one", "two"):
        out = tmp_path / name
        options = ["--data", str(shard_directory), "--out", str(out), "--iterations", "4"]
        options += ["--batch-size", "4", "--device", "cpu", "--threads", "1"]
        options += ["--free-share", "0", "--near-miss-share", "0"]
        done = _torchrun(script, *options)
        assert done.returncode == 0, done.stderr
        weights.append(load_net(out / "emd_net.safetensors").state_dict())
        assert done.stdout.count("weights:") == 1 and "2 processes" in done.stdout
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])
    assert read_provenance(tmp_path / "one" / "emd_net.safetensors")["processes"] == 2
    data = load_sequences([shard_directory])
    run = Run(tmp_path / "one", iterations=4)
    config = TrainingConfig(batch_size=4)
    with pytest.raises(InvalidInputError, match="processes"):
        Trainer(data, SpatialNetConfig(widths=(4, 4, 4), moved_width=2), config, run)


def test_processes_draw_batches_of_their_own(shard_directory: Path, tmp_path: Path) -> None:
    """By rank and iteration, and again the same."""
    data, net = load_sequences([shard_directory]), SpatialNetConfig((32, 32, 16), (4, 4, 4), 2, 1)
    turns = AugmentationConfig(free_share=0.0, near_miss_share=0.0)
    config = TrainingConfig(batch_size=4, bfloat16=False, augmentation=turns)
    batches = []
    for rank, iteration in ((0, 0), (0, 0), (1, 0), (0, 1)):
        run = Run(tmp_path / str(len(batches)), iterations=9, group=ProcessGroup(rank))
        trainer = Trainer(data, net, config, run)
        trainer.iteration = iteration
        batches.append(trainer._batch().manipulations)
    torch.testing.assert_close(batches[0], batches[1])
    assert not torch.equal(batches[0], batches[2]) and not torch.equal(batches[0], batches[3])


def test_without_torchrun_a_process_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It leads itself, and its mean is its own."""
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    group = join_processes(torch.device("cpu"))
    tensor = torch.ones(3)
    group.average([tensor])
    assert group == ProcessGroup() and group.leads
    assert torch.equal(tensor, torch.ones(3)) and group.of_leader(2.5) == 2.5
