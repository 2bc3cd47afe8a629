"""`./cell replay`: a bag through the perception node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rclpy
from rich.console import Console

from emd_cell.bag_frames import required_topics
from emd_cell.bag_reader import BagReader, BagTopics
from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher, NodeSpec
from emd_cell.replay_clock import ReplayClock
from emd_cell.replay_summary import ReplaySummary
from emd_cell.ros.replay import BagReplay
from emd_cell.ros.replay_client import NAMESPACE, ReplayClient
from emd_perception.calibration.calibration import Calibration
from emd_perception.frame_input import InputConfig

# Longest start of perception, seconds: the first one in a checkout compiles its kernels.
_START = 300.0


def run_replay(
    bag: Path,
    topics: BagTopics,
    out: Path,
    console: Console,
    rate: float = 0.0,
    config: InputConfig | None = None,
    calibration: Path | None = None,
) -> ReplaySummary:
    """Start perception, play the bag through it, write grids, summary, report, contact sheet.

    Args:
        bag: A rosbag2 directory or a .bag of ROS 1.
        topics: Of the bag.
        out: Folder to write to.
        console: For the state of the work.
        rate: Recorded seconds a second; 0: as fast as perception answers. The grids are the same
            at any rate.
        config: What the camera gave; registered depth if None.
        calibration: File of `./cell calibrate`, used instead of the bag's camera pose.

    Raises:
        InvalidInputError: If the bag, its topics, the rate or the calibration cannot be used.
    """
    config = config or InputConfig()
    ReplayClock(rate)
    if calibration is not None:
        Calibration.load(calibration)
    with BagReader(bag, topics, required_topics(config)) as reader:
        total = reader.message_count  # a wrong bag is refused before anything starts
    use_large_messages()
    with console.status("starting perception") as status:
        with Launcher([_perception(config, calibration)], out / "logs", console.log) as launcher:
            rclpy.init()
            client = ReplayClient(config)
            try:
                client.wait_for_perception(_START, launcher.require_alive)
                replay = BagReplay(client, out, rate, launcher.require_alive)
                return replay.run(
                    bag,
                    topics,
                    config,
                    lambda summary: status.update(
                        f"{summary.frames} frames played, of {total} messages"
                    ),
                )
            finally:
                client.destroy_node()
                rclpy.try_shutdown()


def _perception(config: InputConfig, calibration: Path | None) -> NodeSpec:
    parameters: dict[str, Any] = {"node.max_rate": 0.0, "node.reliable": True}
    for name, value in vars(config).items():
        parameters[f"input.{name}"] = list(value) if isinstance(value, tuple) else value
    if calibration is not None:
        parameters["node.calibration"] = str(calibration.resolve())
    return NodeSpec(
        "perception", "emd_perception.ros.perception_node", parameters, namespace=NAMESPACE
    )
