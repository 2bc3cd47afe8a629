"""Plays a bag through the perception node, frame by frame, and keeps what it makes of it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image

from emd_cell.bag_reader import BagMessage, BagReader, BagTopics
from emd_core.errors import DeadlineError
from emd_core.pair_matcher import PairMatcher
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED
from emd_core.voxel_grid import VoxelGrid
from emd_core.whole_file import write_text
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg

NAMESPACE = "/replay"  # keeps the replay apart from a live cell
_TOLERANCE = 20_000_000  # ns between colour and depth of one moment


@dataclass
class ReplaySummary:
    """What became of the frames of a bag.

    Attributes:
        bag: The bag's path as given.
        frames: Colour-depth pairs played.
        grids: One entry for every grid: file, stamp (ns), occupied voxels, quality, reason.
        skipped: One entry for every message or pair without a grid: stamp (ns) and reason.
        unpaired: Images left out because none of the other kind was taken at the same moment.
    """

    bag: str
    frames: int = 0
    grids: list[dict[str, Any]] = field(default_factory=list)
    skipped: list[dict[str, Any]] = field(default_factory=list)
    unpaired: int = 0


class ReplayClient(Node):
    """Publishes one pair of images at a time and waits for the answer to it."""

    def __init__(self) -> None:
        """Make the publishers and subscriptions in the replay's own namespace."""
        super().__init__("replay", namespace=NAMESPACE)
        self._publishers_by_kind = {
            "color": self.create_publisher(Image, "camera/color/image_raw", 5),
            "depth": self.create_publisher(Image, "camera/depth_registered/image_raw", 5),
            "info": self.create_publisher(CameraInfo, "camera/color/camera_info", 5),
            "pose": self.create_publisher(PoseStamped, "camera/pose", LATCHED),
        }
        self._known: dict[str, BagMessage] = {}
        self._grids: dict[int, VoxelGrid] = {}
        self._verdicts: dict[int, dict[str, str]] = {}
        sensor = qos_profile_sensor_data
        self.create_subscription(VoxelGridMsg, "perception/voxel_grid", self._on_grid, sensor)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def wait_for_perception(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the perception node listens to the images.

        Raises:
            DeadlineError: If it does not within `timeout` seconds.
        """
        deadline = time.monotonic() + timeout
        wanted = ("color", "depth", "info", "pose")
        while any(self._publishers_by_kind[kind].get_subscription_count() == 0 for kind in wanted):
            check()
            if time.monotonic() > deadline:
                raise DeadlineError(f"the perception node did not appear within {timeout:.0f} s")
            self._spinner.spin_once(timeout_sec=0.05)
        # That side may know of its readers a little later than this one knows of them.
        settled = time.monotonic() + 1.0
        while time.monotonic() < settled:
            self._spinner.spin_once(timeout_sec=0.05)

    def publish(self, message: BagMessage) -> None:
        """Send a message as it was recorded; calibration and pose again with every pair."""
        if message.kind in ("info", "pose"):
            self._known[message.kind] = message
        self._publishers_by_kind[message.kind].publish(bytes(message.data))

    def play_pair(
        self, color: BagMessage, depth: BagMessage, timeout: float = 20.0
    ) -> tuple[VoxelGrid | None, dict[str, str]]:
        """Send a pair and wait for perception's verdict, and for the grid if there is one.

        Raises:
            DeadlineError: If perception says nothing about the pair.
        """
        deadline = time.monotonic() + timeout
        resend = 0.0
        while not self._answered(color.stamp):
            if time.monotonic() > deadline:
                raise DeadlineError(f"perception did not answer within {timeout:.0f} s")
            if time.monotonic() > resend:  # images are sent best effort
                for known in list(self._known.values()):
                    self.publish(known)
                self.publish(color)
                self.publish(depth)
                resend = time.monotonic() + 5.0
            self._spinner.spin_once(timeout_sec=0.02)
        return self._grids.pop(color.stamp, None), self._verdicts.pop(color.stamp)

    def _answered(self, stamp: int) -> bool:
        verdict = self._verdicts.get(stamp)
        return verdict is not None and (verdict["grid"] == "no" or stamp in self._grids)

    def _on_grid(self, message: VoxelGridMsg) -> None:
        self._grids[_nanoseconds(message)] = conversions.voxel_grid_from_message(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id == f"{NAMESPACE}/perception":
                values = {item.key: item.value for item in status.values}
                self._verdicts[_nanoseconds(message)] = {**values, "reason": status.message}


def replay_bag(
    bag: Path,
    topics: BagTopics,
    out: Path,
    client: ReplayClient,
    on_frame: Callable[[ReplaySummary], None],
) -> ReplaySummary:
    """Play every pair of a bag through perception and write grids and summary.json to `out`.

    Raises:
        InvalidInputError: If the bag or its topics cannot be read.
    """
    summary = ReplaySummary(str(bag))
    matcher = PairMatcher[BagMessage](("color", "depth"), _TOLERANCE)
    with BagReader(bag, topics) as reader:
        out.mkdir(parents=True, exist_ok=True)
        for kind in ("info", "pose"):  # a bag may hold images from before the first of them
            known = reader.first(kind)
            if known is not None:
                client.publish(known)
        for message in reader.messages():
            if message.error:
                reason = f"{message.kind} message cannot be decoded: {message.error}"
                summary.skipped.append({"stamp": message.stamp, "reason": reason})
            elif message.kind in ("info", "pose"):
                client.publish(message)
            else:
                pair = matcher.add(message.kind, message.stamp, message)
                if pair is not None:
                    _play(client, *pair, out, summary)
                    on_frame(summary)
    summary.unpaired = matcher.unpaired + matcher.waiting
    write_text(out / "summary.json", json.dumps(vars(summary), indent=1))
    return summary


def _play(
    client: ReplayClient, color: BagMessage, depth: BagMessage, out: Path, summary: ReplaySummary
) -> None:
    grid, verdict = client.play_pair(color, depth)
    index = summary.frames
    summary.frames += 1
    if grid is None:
        summary.skipped.append({"stamp": color.stamp, "reason": verdict["reason"]})
        return
    file = f"voxel_grid_{index:06d}.npz"
    grid.save(out / file)
    summary.grids.append(
        {
            "file": file,
            "stamp": color.stamp,
            "occupied_voxels": int(grid.occupancy.sum()),
            "quality": float(verdict["quality"]),
            "reason": verdict["reason"],
        }
    )


def _nanoseconds(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
