"""Perception as a node at camera rate: rate, latency, drops and memory while images stream.

A process of its own publishes a noisy scene of the cell at 30 Hz and 640 x 480; the node, as
`./cell up` starts it but without its rate limit of 1 Hz, perceives what it can. EMD_STREAM_MINUTES
(10) says how long; the first minute is warm-up and no part of the memory's trend. The scene is
still; with EMD_STREAM_MOST_USES=0 each frame is outlined anew, as if something moved all the time.
"""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from domain_coordinator import domain_id
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rich.console import Console
from rich.progress import Progress

from emd_cell.bench import BenchmarkResult
from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher, NodeSpec
from emd_perception.config import SegmentationConfig

MINUTES = float(os.environ.get("EMD_STREAM_MINUTES", "10"))
MOST_USES = int(os.environ.get("EMD_STREAM_MOST_USES", SegmentationConfig().most_uses))
SAMPLE = 5.0  # seconds between two rows
WARM_UP = 60.0
RATE = 30.0
CAMERA = Path(__file__).with_name("stream_camera.py")
PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass
class Row:
    """One look at the node.

    Attributes:
        seconds: Since the first pair of images.
        resident_mb: Memory of the node's process.
        cpu_seconds: Time that it has used so far.
        figures: What the node says of its camera.
    """

    seconds: float
    resident_mb: float
    cpu_seconds: float
    figures: dict[str, str] = field(default_factory=dict)


class Listener(Node):
    """Keeps the node's last words about its camera."""

    def __init__(self) -> None:
        """Listen to /diagnostics."""
        super().__init__("stream_listener")
        self.figures: dict[str, str] = {}
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "perception: camera":
                self.figures = {item.key: item.value for item in status.values}


def run() -> BenchmarkResult:
    """Stream for `MINUTES`."""
    use_large_messages()
    parameters = {
        "node.max_rate": RATE,
        "segmentation.most_uses": MOST_USES,
        "node.reliable": True,
    }
    node = NodeSpec("perception", "emd_perception.ros.perception_node", parameters, restart=False)
    with domain_id() as number, tempfile.TemporaryDirectory() as folder:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        with Launcher([node], Path(folder)) as launcher:
            camera = subprocess.Popen([sys.executable, CAMERA, str(RATE)])
            try:
                rows = _watch(launcher, launcher.process_id("perception"))
            finally:
                camera.kill()
                camera.wait()
    config = {
        "minutes": MINUTES,
        "rate_hz": RATE,
        "most_uses": MOST_USES,
        "width": 640,
        "height": 480,
    }
    return BenchmarkResult(config, [asdict(row) for row in rows], _summary(rows))


def _watch(launcher: Launcher, process: int) -> list[Row]:
    rclpy.init()
    listener = Listener()
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    rows: list[Row] = []
    try:
        while float(listener.figures.get("frames", "0")) == 0:
            launcher.require_alive()
            executor.spin_once(timeout_sec=0.5)
        start = time.monotonic()
        with Progress(console=Console(stderr=True)) as bar:
            task = bar.add_task("seconds", total=60.0 * MINUTES)
            while time.monotonic() - start < 60.0 * MINUTES:
                executor.spin_once(timeout_sec=0.5)
                launcher.require_alive()
                bar.update(task, completed=time.monotonic() - start)
                if time.monotonic() - start >= SAMPLE * len(rows):
                    rows.append(_look(process, time.monotonic() - start, listener.figures))
    finally:
        listener.destroy_node()
        rclpy.try_shutdown()
    return rows


def _look(process: int, seconds: float, figures: dict[str, str]) -> Row:
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])  # utime, stime: fields 14 and 15 of the whole line
    return Row(seconds, pages * PAGE / 2**20, ticks / os.sysconf("SC_CLK_TCK"), dict(figures))


def _summary(rows: list[Row]) -> dict[str, Any]:
    settled = [row for row in rows if row.seconds >= min(WARM_UP, 30.0 * MINUTES)]
    memory = np.array([row.resident_mb for row in settled])
    minutes = np.array([row.seconds for row in settled]) / 60.0
    slope = float(np.polyfit(minutes, memory, 1)[0]) if len(settled) > 1 else float("nan")
    last, first = settled[-1], settled[0]
    elapsed = last.seconds - first.seconds
    frames = float(last.figures["frames"]) - float(first.figures["frames"])
    return {
        "frames_per_second": frames / max(elapsed, 1e-9),
        "cpu_share": (last.cpu_seconds - first.cpu_seconds) / max(elapsed, 1e-9),
        "cpu_ms_a_frame": 1e3 * (last.cpu_seconds - first.cpu_seconds) / max(frames, 1.0),
        "memory_mb": float(memory.mean()),
        "memory_growth_mb_a_minute": slope,
        "memory_range_mb": float(memory.max() - memory.min()),
        "last_figures": last.figures,
    }
