"""Reads the camera's topics out of any bag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError

from emd_cell.bag_types import cell_typestore
from emd_core.errors import InvalidInputError

_KINDS = {
    "color": ("sensor_msgs/msg/Image",),
    "depth": ("sensor_msgs/msg/Image",),
    "info": ("sensor_msgs/msg/CameraInfo",),
    "pose": ("geometry_msgs/msg/PoseStamped",),
}


@dataclass(frozen=True)
class BagTopics:
    """Names of the topics to take from a bag.

    Attributes:
        color: Colour image.
        depth: Depth image, registered to the colour image.
        info: Calibration of the colour camera.
        pose: Pose of the camera's optical frame in the table frame; optional in the bag.
    """

    color: str = "/camera/color/image_raw"
    depth: str = "/camera/depth_registered/image_raw"
    info: str = "/camera/color/camera_info"
    pose: str = "/camera/pose"


@dataclass(frozen=True)
class BagMessage:
    """One message of a bag.

    Attributes:
        kind: color, depth, info or pose.
        stamp: Time of the header, nanoseconds; -1 if the message cannot be decoded.
        data: The serialised message, CDR.
        error: Why it cannot be decoded, or empty.
    """

    kind: str
    stamp: int
    data: bytes
    error: str = ""


class BagReader:
    """A context in which the messages of the camera's topics can be iterated."""

    def __init__(self, path: Path, topics: BagTopics) -> None:
        """Read the bag at `path` (a rosbag2 directory: mcap or sqlite3)."""
        self._path = path
        self._topics = topics
        self._reader: AnyReader | None = None

    def __enter__(self) -> BagReader:
        """Open the bag and check that it holds the topics.

        Raises:
            InvalidInputError: If it is no readable bag or a topic is missing or of another type.
        """
        if not self._path.exists():
            raise InvalidInputError(f"there is no bag at {self._path}")
        try:
            self._reader = AnyReader([self._path], default_typestore=cell_typestore())
            self._reader.open()
        except (AnyReaderError, OSError, ValueError, KeyError) as err:
            raise InvalidInputError(
                f"{self._path} is not a readable rosbag2 directory (metadata.yaml with mcap or "
                f"sqlite3 beside it): {err}"
            ) from err
        try:
            self._check_topics(self._reader)
        except InvalidInputError:
            self._reader.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        if self._reader is not None:
            self._reader.close()

    def first(self, kind: str) -> BagMessage | None:
        """Give the first message of a kind that can be decoded, or None if there is none."""
        return next((message for message in self.messages(kind) if not message.error), None)

    def messages(self, *only: str) -> Iterator[BagMessage]:
        """Give the wanted topics' messages, or those of some kinds, in the order of recording."""
        assert self._reader is not None
        kinds = {
            name: kind for kind, name in vars(self._topics).items() if not only or kind in only
        }
        connections = [item for item in self._reader.connections if item.topic in kinds]
        for connection, _, raw in self._reader.messages(connections=connections):
            kind = kinds[connection.topic]
            try:
                stamp = _stamp(self._reader.deserialize(raw, connection.msgtype))
            except Exception as err:  # a broken message must not end the replay of the others
                yield BagMessage(kind, -1, raw, f"{type(err).__name__}: {err}")
                continue
            yield BagMessage(kind, stamp, raw)

    def _check_topics(self, reader: AnyReader) -> None:
        present = {item.topic: item.msgtype for item in reader.connections}
        for kind, types in _KINDS.items():
            topic = getattr(self._topics, kind)
            if kind == "pose" and topic not in present:
                continue
            if present.get(topic) in types:
                continue
            others = [name for name, message_type in present.items() if message_type in types]
            found = f"it is a {present[topic]}" if topic in present else "the bag does not have it"
            raise InvalidInputError(
                f"topic {topic} ({kind}) of type {types[0]} is needed, but {found}; topics "
                f"of that type: {', '.join(sorted(others)) or 'none'}. "
                f"Name the right one with --{kind}"
            )


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
