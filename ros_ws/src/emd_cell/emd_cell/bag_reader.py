"""Reads the camera's topics out of any bag: rosbag2 (mcap, sqlite3) or a .bag of ROS 1."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from rosbags.convert.converter import generate_message_converter
from rosbags.highlevel import AnyReader

from emd_cell.bag_types import cell_typestore
from emd_core.errors import InvalidInputError

IMAGE, CLOUD = "sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"
_KINDS = {
    "color": (IMAGE,),
    "depth": (IMAGE, CLOUD),
    "info": ("sensor_msgs/msg/CameraInfo",),
    "depth_info": ("sensor_msgs/msg/CameraInfo",),
    "pose": ("geometry_msgs/msg/PoseStamped",),
}
_OPTIONAL = ("pose", "depth_info")
DAMAGE = "bag"  # kind of the message that tells that the rest cannot be read


@dataclass(frozen=True)
class BagTopics:
    """Names of the topics to take from a bag.

    Attributes:
        color: Colour image.
        depth: Depth image, or point cloud.
        info: Calibration of the colour camera.
        pose: Pose of the camera's optical frame in the table frame; optional in the bag.
        depth_info: Calibration of the depth camera; for depth that is not registered.
    """

    color: str = "/camera/color/image_raw"
    depth: str = "/camera/depth_registered/image_raw"
    info: str = "/camera/color/camera_info"
    pose: str = "/camera/pose"
    depth_info: str = "/camera/depth/camera_info"


@dataclass(frozen=True)
class BagMessage:
    """One message of a bag.

    Attributes:
        kind: A field of `BagTopics`, or `DAMAGE`.
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

    def __init__(self, path: Path, topics: BagTopics, required: tuple[str, ...] = ()) -> None:
        """Read the bag at `path`.

        Args:
            path: A rosbag2 directory, or a .bag file of ROS 1, which is converted while it is
                read.
            topics: What to take from it.
            required: Otherwise optional topics that must be there.
        """
        self._path = path
        self._topics = topics
        self._optional = [kind for kind in _OPTIONAL if kind not in required]
        self._store = cell_typestore()
        self._reader: AnyReader | None = None
        self._converters: dict[str, Callable[[bytes], Any]] = {}

    def __enter__(self) -> BagReader:
        """Open the bag and check that it holds the topics.

        Raises:
            InvalidInputError: If it is no readable bag or a topic is missing or of another type.
        """
        if not self._path.exists():
            raise InvalidInputError(f"there is no bag at {self._path}")
        try:
            self._reader = AnyReader([self._path], default_typestore=self._store)
            self._reader.open()
        except Exception as err:  # rosbags raises whatever damaged bytes lead it to
            raise InvalidInputError(
                f"{self._path} is not a readable bag: a rosbag2 directory (metadata.yaml with "
                f"mcap or sqlite3 beside it) or a .bag of ROS 1: {type(err).__name__}: {err}"
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

    @property
    def has_points(self) -> bool:
        """Whether the depth comes as a point cloud."""
        return any(
            item.topic == self._topics.depth and item.msgtype == CLOUD
            for item in self._opened.connections
        )

    @property
    def message_count(self) -> int:
        """How many messages the wanted topics have, as the bag's index tells."""
        wanted = set(vars(self._topics).values())
        return sum(item.msgcount for item in self._opened.connections if item.topic in wanted)

    def first(self, kind: str) -> BagMessage | None:
        """Give the first message of a kind that can be decoded, or None if there is none."""
        return next((message for message in self.messages(kind) if not message.error), None)

    def messages(self, *only: str) -> Iterator[BagMessage]:
        """Give the wanted topics' messages, or those of some kinds, in the order of recording.

        Where the bag is damaged, a last message of kind `DAMAGE` says so.
        """
        kinds = {
            name: kind for kind, name in vars(self._topics).items() if not only or kind in only
        }
        connections = [item for item in self._opened.connections if item.topic in kinds]
        if not connections:
            return
        records = self._opened.messages(connections=connections)
        while True:
            try:
                connection, _, raw = next(records)
            except StopIteration:
                return
            except Exception as err:  # rosbags raises whatever damaged bytes lead it to
                text = f"the bag is damaged from here on: {type(err).__name__}: {err}"
                yield BagMessage(DAMAGE, -1, b"", text)
                return
            yield self._message(kinds[connection.topic], bytes(raw), connection.msgtype)

    def decode(self, message: BagMessage) -> Any:
        """Give a message's fields as attributes; those of `BagMessage` with an error have none."""
        kind = CLOUD if message.kind == "depth" and self.has_points else _KINDS[message.kind][0]
        return self._store.deserialize_cdr(message.data, kind)

    @property
    def _opened(self) -> AnyReader:
        assert self._reader is not None, "used outside of its `with` block"
        return self._reader

    def _message(self, kind: str, raw: bytes, message_type: str) -> BagMessage:
        try:
            data = raw if self._opened.is2 else bytes(self._converter(message_type)(raw))
            stamp = self._store.deserialize_cdr(data, message_type).header.stamp  # type: ignore[attr-defined]
            nanoseconds = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        except Exception as err:  # a broken message must not end the replay of the others
            return BagMessage(kind, -1, raw, f"{type(err).__name__}: {err}")
        return BagMessage(kind, nanoseconds, data)

    def _converter(self, message_type: str) -> Callable[[bytes], Any]:
        """Turn a serialised message of ROS 1 into one of ROS 2."""
        if message_type not in self._converters:
            with redirect_stdout(StringIO()):  # it prints which types it adapts
                self._converters[message_type] = generate_message_converter(
                    self._opened.typestore,
                    self._store,
                    message_type,
                    message_type,
                    {},
                    src_is2=False,
                    dst_is2=True,
                )
        return self._converters[message_type]

    def _check_topics(self, reader: AnyReader) -> None:
        present = {item.topic: item.msgtype for item in reader.connections}
        for kind, types in _KINDS.items():
            topic = getattr(self._topics, kind)
            if kind in self._optional and topic not in present:
                continue
            if present.get(topic) in types:
                continue
            others = [name for name, message_type in present.items() if message_type in types]
            found = f"it is a {present[topic]}" if topic in present else "the bag does not have it"
            raise InvalidInputError(
                f"topic {topic} ({kind}) of type {' or '.join(types)} is needed, but {found}; "
                f"topics of that type: {', '.join(sorted(others)) or 'none'}. "
                f"Name the right one with --{kind.replace('_', '-')}"
            )
