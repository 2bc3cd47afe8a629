"""Claims about generation on a Ray cluster; they need the optional extra."""

import os
import signal
import sys
from pathlib import Path

import pytest

from emd_cloth_sim.generate import GenerationProgress, generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.ray_workers import RayRunner
from emd_core.errors import InvalidInputError

CONFIG = GenerationConfig(sequences=24, steps=2, seed=3, vertices=(11, 11), shard_size=5)


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of all files of a folder."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch):
    """Two nodes of one core each, on loopback addresses of this machine."""
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    ray = pytest.importorskip("ray")
    cluster_utils = pytest.importorskip("ray.cluster_utils")
    cluster = cluster_utils.Cluster(
        initialize_head=True,
        head_node_args={
            "num_cpus": 1,
            "include_dashboard": False,
            "node_ip_address": "127.0.0.2",
            # Results stay on the node that made them, as those of a fine mesh do.
            "_system_config": {"max_direct_call_object_size": 1000},
        },
    )
    try:
        cluster.add_node(num_cpus=1, node_ip_address="127.0.0.3")
        yield cluster
    finally:
        ray.shutdown()
        cluster.shutdown()


def has_simulated(raylet: int) -> bool:
    """Whether a worker of a node has loaded the solver, which it does for its first sequence."""
    for child in Path(f"/proc/{raylet}/task/{raylet}/children").read_text().split():
        try:
            if "libllvmlite" in Path(f"/proc/{child}/maps").read_text():
                return True
        except OSError:
            continue  # it has just ended
    return False


@pytest.mark.slow
def test_node_killed_half_way_changes_nothing(cluster, tmp_path: Path) -> None:
    """With one of two working nodes killed the data set is complete and that of one process."""
    generate(CONFIG, tmp_path / "one")
    (second,) = cluster.worker_nodes
    raylet = second.all_processes["raylet"][0].process
    killed_at = []

    def kill_second_half_way(progress: GenerationProgress) -> None:
        late = progress.new >= CONFIG.sequences // 3
        if not killed_at and late and has_simulated(raylet.pid):
            killed_at.append(progress.new)
            os.kill(raylet.pid, signal.SIGKILL)

    made = generate(CONFIG, tmp_path / "ray", RayRunner(cluster.address), kill_second_half_way)
    assert killed_at and killed_at[0] < CONFIG.sequences and raylet.poll() is not None
    assert made.new == CONFIG.sequences
    assert contents(tmp_path / "ray") == contents(tmp_path / "one")


def test_cluster_that_does_not_answer_is_an_input_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wrong address is refused with the way to start a cluster."""
    ray = pytest.importorskip("ray")

    def refuse(**_: object) -> None:
        raise ConnectionError("nobody there")

    monkeypatch.setattr(ray, "init", refuse)
    with pytest.raises(InvalidInputError, match="ray start --head"):
        generate(CONFIG, tmp_path, RayRunner("127.0.0.1:1"))


def test_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without Ray the message says how to install it, and what was done stays."""
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InvalidInputError, match="requirements-ray.txt"):
        generate(CONFIG, tmp_path, RayRunner("auto"))
