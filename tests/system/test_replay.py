"""`./cell replay` on a bag that `--record`'s node has written from the running cell."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from emd_cell.bag_reader import BagTopics
from emd_cell.bag_types import cell_typestore
from emd_cell.launcher import Launcher
from emd_cell.nodes import recorder_node
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid

pytestmark = pytest.mark.system

TOPICS = BagTopics()
Damage = Callable[..., bytes]  # of the typestore, a connection, its message, and that serialised
ENOUGH = 12_000_000  # bytes; a pair of images has 1.5 million


@pytest.fixture(scope="module")
def bag(client, tmp_path_factory) -> Path:
    """Some pairs of images and what else the cell publishes meanwhile."""
    folder = tmp_path_factory.mktemp("bags")
    bag = folder / "recorded"
    deadline = time.monotonic() + 120.0
    with Launcher([recorder_node(bag)], folder / "logs") as recorder:
        client.reset_simulation()
        while sum(file.stat().st_size for file in bag.glob("*.mcap")) < ENOUGH:
            assert time.monotonic() < deadline, recorder.log_tail("recorder")
            recorder.require_alive()
            time.sleep(0.1)
    return bag


def replay(bag: Path, out: Path) -> subprocess.CompletedProcess[str]:
    """Call the command as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "emd_cell.cli", "replay", str(bag), "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=600,
    )


def summary_of(out: Path) -> dict:
    """What the replay wrote about itself."""
    return json.loads((out / "summary.json").read_text())


def spoil(bag: Path, target: Path, damages: Sequence[Damage]) -> Path:
    """Copy calibration, pose and images: a pair for each of `damages`, then a whole one."""
    store = cell_typestore()
    pairs = len(damages) + 1
    left = {TOPICS.color: pairs, TOPICS.depth: pairs, TOPICS.info: 1, TOPICS.pose: 1}
    with (
        AnyReader([bag], default_typestore=store) as reader,
        Writer(target, version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        connections = {
            item.topic: writer.add_connection(item.topic, item.msgtype, typestore=store)
            for item in reader.connections
            if item.topic in left
        }
        stamps = _stamps_of_pairs(reader)
        for item, time_of_writing, raw in reader.messages():
            if left.get(item.topic, 0) == 0:
                continue
            message = reader.deserialize(raw, item.msgtype)
            if item.topic in (TOPICS.color, TOPICS.depth):
                stamp = (message.header.stamp.sec, message.header.stamp.nanosec)
                if stamp not in stamps:
                    continue
                if left[item.topic] > 1:
                    damage = damages[pairs - left[item.topic]]
                    raw = damage(store, item, message, bytes(raw))
            left[item.topic] -= 1
            writer.write(connections[item.topic], time_of_writing, raw)
    return target


def _stamps_of_pairs(reader: AnyReader) -> set[tuple[int, int]]:
    """Stamps for which both a colour and a depth image were recorded."""
    stamps: dict[str, set[tuple[int, int]]] = {TOPICS.color: set(), TOPICS.depth: set()}
    for item, _, raw in reader.messages():
        if item.topic in stamps:
            stamp = reader.deserialize(raw, item.msgtype).header.stamp
            stamps[item.topic].add((stamp.sec, stamp.nanosec))
    return stamps[TOPICS.color] & stamps[TOPICS.depth]


def half_as_wide(store, item, message, raw: bytes) -> bytes:
    """A depth image of another size than the colour image."""
    if item.topic != TOPICS.depth:
        return raw
    pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    message.width //= 2
    message.step //= 2
    message.data = np.ascontiguousarray(pixels[:, : message.step]).ravel()
    return bytes(store.serialize_cdr(message, item.msgtype))


def claims_too_much(store, item, message, raw: bytes) -> bytes:
    """A colour image that carries 30 bytes."""
    if item.topic != TOPICS.color:
        return raw
    message.data = message.data[:30].copy()
    return bytes(store.serialize_cdr(message, item.msgtype))


def cut_off(store, item, message, raw: bytes) -> bytes:
    """A depth message whose serialised form ends too early."""
    return raw[:100] if item.topic == TOPICS.depth else raw


@pytest.mark.slow
def test_two_replays_give_the_same_grids(bag, client, tmp_path) -> None:
    """Every recorded pair is played; the grids are equal bit by bit and show the cloth."""
    outs = [tmp_path / name for name in ("first", "second")]
    for out in outs:
        done = replay(bag, out)
        assert done.returncode == 0, done.stderr
    first, second = (summary_of(out) for out in outs)
    assert first["frames"] >= 3
    assert not first["skipped"]
    assert first["grids"] == second["grids"]
    truth = client.true_grid()
    for entry in first["grids"]:
        grids = [VoxelGrid.load(out / entry["file"]) for out in outs]
        assert (grids[0].occupancy == grids[1].occupancy).all()
        assert voxel_mse(grids[0], truth) < 0.01


def test_broken_pairs_are_skipped_with_their_reasons(bag, tmp_path) -> None:
    """The node lives on: the pair after the broken ones gives its grid."""
    broken = {
        half_as_wide: "320",
        claims_too_much: "30",
        cut_off: "depth message cannot be decoded",
    }
    done = replay(spoil(bag, tmp_path / "spoilt", list(broken)), tmp_path / "out")
    assert done.returncode == 0, done.stderr
    summary = summary_of(tmp_path / "out")
    assert len(summary["grids"]) == 1, summary
    for reason in broken.values():
        assert any(reason in entry["reason"] for entry in summary["skipped"]), reason


def test_a_bag_without_depth_is_refused(tmp_path) -> None:
    """One line on stderr that names the topic and the remedy; status 2; nothing is written."""
    bag = Path(__file__).parents[2].parent / "shared" / "data" / "bags" / "button_light"
    if not bag.exists():
        pytest.skip(f"{bag} is not here")
    done = replay(bag, tmp_path / "out")
    assert done.returncode == 2
    assert "--depth" in done.stderr or "--color" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
