"""`./cell replay` as a user calls it, on bags of a small camera."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from bag_files import (
    TOPICS,
    Recorded,
    as_ros1,
    calibration_and_pose,
    cloth_scene,
    colour_message,
    pairs,
    recorded,
    write_bag,
)
from own_domain import own_domain
from perception_scenes import Scene

from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid

pytestmark = pytest.mark.system

COMMAND = (sys.executable, "-m", "emd_cell.cli", "replay")
SECOND = 1_000_000_000
START = 10 * SECOND
STAMPS = [START + index * SECOND // 10 for index in range(6)]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A cloth in three noisy frames."""
    return cloth_scene(3)


@pytest.fixture(scope="module")
def messages(scene) -> list[Recorded]:
    """Six good pairs; between them what may go wrong."""
    broken = colour_message(scene, STAMPS[2] + SECOND // 30)
    broken.data = broken.data[:30]
    strange = colour_message(scene, STAMPS[3] + SECOND // 30)
    strange.encoding = "yuv422_yuy2"
    late = START + 400 * SECOND  # the clock jumps ahead and back
    found = [*calibration_and_pose(scene, START), *pairs(scene, STAMPS)]
    for bad in (broken, strange):
        stamp = bad.header.stamp.sec * SECOND + bad.header.stamp.nanosec
        found += [recorded("color", stamp, bad), pairs(scene, [stamp])[1]]
    found.append(Recorded("depth", START, found[3].data[:50]))
    found += pairs(scene, [late, STAMPS[0]])
    return found


@pytest.fixture(scope="module")
def bag(messages, tmp_path_factory) -> Path:
    """All of it in a rosbag2."""
    ordered = [
        Recorded(message.kind, START + index, message.data)
        for index, message in enumerate(messages)
    ]
    return write_bag(tmp_path_factory.mktemp("bags") / "bag", ordered)


def replay(bag: Path, out: Path, *options: str) -> dict:
    """Call the command; gives its summary."""
    with own_domain() as number:
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "emd_cell.cli",
                "replay",
                str(bag),
                "--out",
                str(out),
                *options,
            ],
            capture_output=True,
            text=True,
            timeout=600,
            env={**os.environ, "ROS_DOMAIN_ID": str(number)},
        )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return json.loads((out / "summary.json").read_text())


@pytest.fixture(scope="module")
def fast(bag, tmp_path_factory) -> tuple[Path, dict]:
    """The bag, as fast as perception answers."""
    out = tmp_path_factory.mktemp("fast")
    return out, replay(bag, out)


def test_every_pair_gives_its_grid_or_a_reason(fast, scene) -> None:
    """Seven pairs show the cloth; what is broken, strange or twice is counted with its reason."""
    out, summary = fast
    assert summary["frames"] == 9
    assert len(summary["grids"]) == 7
    reasons = [entry["reason"] for entry in summary["skipped"]]
    assert len(reasons) == 4
    for part in ("carries 30", "yuv422_yuy2", "cannot be decoded", "played before"):
        assert sum(part in reason for reason in reasons) == 1, (part, reasons)
    assert [round(jump["seconds"]) for jump in summary["clock_jumps"]] == [400, -400]
    for entry in summary["grids"]:
        assert voxel_mse(VoxelGrid.load(out / entry["file"]), scene.grid) < 0.006


def test_the_report_shows_the_frames(fast) -> None:
    """report.md and a contact sheet of all nine frames."""
    out, summary = fast
    assert "9 pairs of images, 7 grids, 4 skipped" in (out / "report.md").read_text()
    sheet = cv2.imread(str(out / "contact_sheet.png"))
    assert sheet.shape[1] == 3 * (240 + 180 + 6)
    assert sheet.shape[0] == 3 * (180 + 20)


@pytest.mark.parametrize("rate", ["2.0", "30"])
def test_any_rate_gives_the_same_grids(bag, fast, tmp_path, rate) -> None:
    """Bit by bit, with the same quality, reasons and skips."""
    out, summary = fast
    slower = replay(bag, tmp_path, "--rate", rate)
    assert slower["grids"] == summary["grids"]
    assert slower["skipped"] == summary["skipped"]
    for entry in summary["grids"]:
        one, other = (VoxelGrid.load(folder / entry["file"]) for folder in (out, tmp_path))
        np.testing.assert_array_equal(one.occupancy, other.occupancy)


def test_a_bag_of_ros_1_gives_the_same_grids(bag, fast, tmp_path) -> None:
    """Without the two messages that no converter takes, all else is equal bit by bit."""
    out, expected = fast
    summary = replay(as_ros1(whole(bag, tmp_path), tmp_path / "old.bag"), tmp_path / "out")
    assert len(summary["grids"]) == len(expected["grids"])
    for one, other in zip(summary["grids"], expected["grids"], strict=True):
        files = tmp_path / "out" / one.pop("file"), out / other["file"]
        assert one == {name: value for name, value in other.items() if name != "file"}
        grids = [VoxelGrid.load(file) for file in files]
        np.testing.assert_array_equal(grids[0].occupancy, grids[1].occupancy)


def whole(bag: Path, folder: Path) -> Path:
    """The bag without what cannot be decoded, which no converter takes."""
    from rosbags.highlevel import AnyReader

    from emd_cell.bag_types import cell_typestore

    kinds = {name: kind for kind, name in vars(TOPICS).items()}
    kept = []
    with AnyReader([bag], default_typestore=cell_typestore()) as reader:
        for connection, stamp, raw in reader.messages():
            if len(raw) > 100 or connection.topic == TOPICS.pose:
                kept.append(Recorded(kinds[connection.topic], stamp, bytes(raw)))
    return write_bag(folder / "whole", kept)


def test_a_wrong_topic_type_is_refused_before_anything_starts(scene, tmp_path) -> None:
    """The camera info on the image's topic: one line and nothing is written."""
    bag = write_bag(tmp_path / "bag", pairs(scene, STAMPS[:1]))
    done = subprocess.run(
        [*COMMAND, str(bag), "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 2
    assert "camera_info" in done.stderr and "--info" in done.stderr
    assert not (tmp_path / "out").exists()
