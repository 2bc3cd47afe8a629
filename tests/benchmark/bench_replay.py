"""How many times faster than it was recorded a bag is replayed, and that the grids stay.

A cloth seen by a noisy Kinect, 640 x 480 at 30 Hz for five seconds, is written as a bag and played
by `./cell replay` as fast as perception answers, and at half the rate of its recording. Processor
time is that of both processes, perception and player; a bag of one pair tells how much of it is
their start.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from domain_coordinator import domain_id

sys.path[:0] = [str(Path(__file__).parents[1] / name) for name in ("emd_cell", "emd_perception")]

from bag_files import (  # noqa: E402
    Recorded,
    calibration_and_pose,
    colour_message,
    depth_message,
    recorded,
    write_bag,
)
from perception_scenes import BLUE, Layer, Scene, rectangle, render  # noqa: E402

from emd_cell.bench import BenchmarkResult  # noqa: E402
from emd_core.pinhole_camera import PinholeCamera  # noqa: E402

SECONDS = 5
RATE = 30  # Hz
DEPTHS = 10  # noisy depth images, one after the other
START = 1_000_000_000_000  # nanoseconds


@dataclass(frozen=True)
class Row:
    """One replay.

    Attributes:
        pairs: Of the bag.
        rate: As given to `--rate`; 0: as fast as perception answers.
        recorded_seconds: Of the bag.
        seconds: From the first pair to the last grid, wall clock.
        times_real_time: Recorded seconds a second.
        cpu_seconds: Processor time of both processes, their start included.
    """

    pairs: int
    rate: float
    recorded_seconds: float
    seconds: float
    times_real_time: float
    cpu_seconds: float


def run() -> BenchmarkResult:
    """Write the bags and play them."""
    scene = render([Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, BLUE)], frames=DEPTHS, seed=4)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        one = _write(folder / "one", scene, 1)
        many = _write(folder / "many", scene, SECONDS * RATE)
        start = _play(one, folder / "started", 0.0)
        fast = _play(many, folder / "fast", 0.0)
        slow = _play(many, folder / "slow", 0.5)
        same = _same_grids(folder / "fast", folder / "slow")
    more = fast.pairs - start.pairs
    summary = {
        "times_real_time": fast.times_real_time,
        "pairs_per_second": fast.pairs / fast.seconds,
        "cpu_ms_a_pair": 1e3 * (fast.cpu_seconds - start.cpu_seconds) / more,
        "grids_same_at_both_rates": same,
    }
    config = {"seconds": SECONDS, "rate_hz": RATE, "width": 640, "height": 480}
    return BenchmarkResult(config, [asdict(row) for row in (start, fast, slow)], summary)


def _write(path: Path, scene: Scene, pairs: int) -> Path:
    messages: list[Recorded] = calibration_and_pose(scene, START, PinholeCamera())
    for number in range(pairs):
        stamp = START + number * 1_000_000_000 // RATE
        messages.append(recorded("color", stamp, colour_message(scene, stamp)))
        depth = depth_message(scene, stamp, number % DEPTHS)
        messages.append(recorded("depth", stamp, depth))
    return write_bag(path, messages)


def _play(bag: Path, out: Path, rate: float) -> Row:
    before = _children_seconds()
    command = [sys.executable, "-m", "emd_cell.cli", "replay", str(bag), "--out", str(out)]
    with domain_id() as number:
        subprocess.run(
            [*command, "--rate", str(rate)],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "ROS_DOMAIN_ID": str(number)},
        )
    used = _children_seconds() - before
    found = json.loads((out / "summary.json").read_text())
    recorded_seconds, seconds = found["recorded_seconds"], found["seconds"]
    speed = recorded_seconds / seconds
    return Row(found["frames"], rate, recorded_seconds, seconds, speed, used)


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _same_grids(one: Path, other: Path) -> bool:
    names = [sorted(file.name for file in folder.glob("*.npz")) for folder in (one, other)]
    if not names[0] or names[0] != names[1]:
        return False
    pairs = ((np.load(one / name), np.load(other / name)) for name in names[0])
    return all(np.array_equal(a["occupancy"], b["occupancy"]) for a, b in pairs)
