"""A recorded motion as a browser replays it: the robot's shapes and where they were, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import Reader

from emd_console.motion import CAMERA_POSE, DESCRIPTION, JOINTS, PHASE, TYPES, seconds_of
from emd_console.robot_view import RobotView, Shape
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, transform_from_pose

RATE = 20.0  # postures a second that are kept


@dataclass(frozen=True)
class Replay:
    """A motion to look at.

    Attributes:
        shapes: The robot's.
        times: Of the postures, seconds of the robot's clock from the first, shape (T,).
        poses: Of the shapes in the base frame: position and quaternion x y z w, shape (T, N, 7).
        phases: When each begins, seconds, and its name.
        transform_table_to_base: Where the table is, shape (4, 4); None if that is not recorded.
    """

    shapes: tuple[Shape, ...]
    times: FloatArray
    poses: NDArray[np.float32]
    phases: tuple[tuple[float, str], ...]
    transform_table_to_base: FloatArray | None


def read_replay(bag: Path, rate: float = RATE) -> Replay:
    """Read a motion's bag.

    Args:
        bag: The folder that `MotionLog.write` made.
        rate: Postures to keep of each second of the robot's clock.

    Raises:
        InvalidInputError: If it cannot be read, or holds no description or no joint states.
    """
    try:
        messages = _messages(bag)
    except Exception as err:  # rosbags raises whatever damaged bytes lead it to
        raise InvalidInputError(f"{bag} is no readable bag: {type(err).__name__}: {err}") from err
    states = messages[JOINTS]
    if not states or not messages[DESCRIPTION]:
        raise InvalidInputError(
            f"{bag} should hold {JOINTS} and {DESCRIPTION}, got {len(states)} and "
            f"{len(messages[DESCRIPTION])} messages"
        )
    view = RobotView(messages[DESCRIPTION][0][1].data)
    clock = np.array([seconds_of(state) for _, state in states])
    chosen = _thinned(clock, rate)
    joints = [_joints(states[index][1]) for index in chosen]
    received = np.array([stamp for stamp, _ in states])
    return Replay(
        tuple(view.shapes),
        clock[chosen] - clock[0],
        np.stack([view.poses(positions) for positions in joints]),
        tuple(
            (float(np.interp(stamp, received, clock) - clock[0]), phase.data)
            for stamp, phase in messages[PHASE]
        ),
        _table(view, joints[0], messages[CAMERA_POSE]),
    )


def _messages(bag: Path) -> dict[str, list[tuple[int, Any]]]:
    """All messages of the topics that a replay needs, with when they came, nanoseconds."""
    found: dict[str, list[tuple[int, Any]]] = {
        topic: [] for topic in (JOINTS, DESCRIPTION, CAMERA_POSE, PHASE)
    }
    with Reader(bag) as reader:
        wanted = [item for item in reader.connections if item.topic in found]
        for connection, stamp, data in reader.messages(connections=wanted):
            message = TYPES.deserialize_cdr(data, connection.msgtype)
            found[connection.topic].append((stamp, message))
    return found


def _joints(state: Any) -> dict[str, float]:
    return dict(zip(state.name, state.position.tolist(), strict=False))


def _thinned(clock: FloatArray, rate: float) -> list[int]:
    """Indices of the states to keep: the first, the last, and others not nearer than 1 / rate."""
    kept = [0]
    for index, time in enumerate(clock):
        if time >= clock[kept[-1]] + 1.0 / rate - 1e-9:
            kept.append(index)
    return kept if kept[-1] == len(clock) - 1 else [*kept, len(clock) - 1]


def _table(
    view: RobotView, joints: Mapping[str, float], poses: list[tuple[int, Any]]
) -> FloatArray | None:
    if not poses:
        return None
    p, q = poses[-1][1].pose.position, poses[-1][1].pose.orientation
    transform = transform_from_pose([p.x, p.y, p.z], [q.x, q.y, q.z, q.w])
    return view.transform_table_to_base(joints, transform)
