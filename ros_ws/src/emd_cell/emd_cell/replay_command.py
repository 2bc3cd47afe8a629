"""`./cell replay`: a bag through the perception node."""

from __future__ import annotations

from pathlib import Path

import rclpy
from rich.console import Console

from emd_cell.bag_reader import BagReader, BagTopics
from emd_cell.launcher import Launcher, NodeSpec
from emd_cell.ros.replay import NAMESPACE, ReplayClient, ReplaySummary, replay_bag


def run_replay(bag: Path, topics: BagTopics, out: Path, console: Console) -> ReplaySummary:
    """Start perception, play the bag through it, write grids and summary.json.

    Raises:
        InvalidInputError: If the bag or its topics cannot be used.
    """
    with BagReader(bag, topics):
        pass  # refuse a wrong bag before anything starts
    perception = NodeSpec(
        "perception",
        "emd_perception.ros.perception_node",
        {"node.max_rate": 0.0, "node.reliable": True},
        namespace=NAMESPACE,
    )
    with console.status("starting perception") as status:
        with Launcher([perception], out / "logs", console.log) as launcher:
            rclpy.init()
            client = ReplayClient()
            try:
                client.wait_for_perception(60.0, launcher.require_alive)
                return replay_bag(
                    bag,
                    topics,
                    out,
                    client,
                    lambda summary: status.update(f"{summary.frames} frames played"),
                )
            finally:
                client.destroy_node()
                rclpy.try_shutdown()
