"""Frames of a running camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from emd_cell.large_messages import use_large_messages
from emd_core.errors import CellError, DeadlineError
from emd_perception.frame_input import Frame, InputConfig
from emd_perception.ros.frame_decoder import FrameDecoder
from emd_perception.ros.frame_pair import FramePair
from emd_perception.ros.frame_source import FrameSource

_TOLERANCE = 0.02  # seconds between colour and depth


def live_frames(
    count: int, config: InputConfig, timeout: float, on_frame: Callable[[int], None]
) -> list[Frame]:
    """Take frames from the camera's topics.

    Args:
        count: How many.
        config: What the camera gives.
        timeout: Seconds that they may take.
        on_frame: Told how many there are.

    Raises:
        DeadlineError: If they do not come in time; says what is missing.
    """
    use_large_messages()
    rclpy.init()
    node = Node("calibrate")
    try:
        return _collect(node, count, config, timeout, on_frame)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _collect(
    node: Node, count: int, config: InputConfig, timeout: float, on_frame: Callable[[int], None]
) -> list[Frame]:
    pairs: SimpleQueue[FramePair] = SimpleQueue()
    source = FrameSource(node, config, pairs.put, _TOLERANCE)
    decoder, frames, complaint = FrameDecoder(config), list[Frame](), ""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + timeout
    while len(frames) < count:
        if time.monotonic() > deadline:
            why = complaint or source.health(min(2.0, timeout / 2)).text
            raise DeadlineError(
                f"{count} frames were wanted within {timeout:.0f} s, {len(frames)} came: {why}"
            )
        executor.spin_once(timeout_sec=0.1)
        try:
            pair = pairs.get_nowait()
            frames.append(decoder.decode(pair.colour, pair.depth, pair.info, pair.depth_info))
            on_frame(len(frames))
        except Empty:
            continue
        except CellError as err:
            complaint = str(err)
    return frames
