"""Bags that cannot be used are refused with a reason; broken messages do not end a replay."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import Header

from emd_cell.bag_reader import BagReader, BagTopics
from emd_cell.bag_types import cell_typestore
from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions

SHARED = Path(__file__).parents[2].parent / "shared" / "data" / "bags"
TOPICS = BagTopics()


def serialised(message) -> bytes:
    """A ROS message as the middleware sends it."""
    from rclpy.serialization import serialize_message

    return serialize_message(message)


def write_bag(
    path: Path, with_depth: bool = True, cut: bool = False, sqlite: bool = False
) -> Path:
    """One pair of images with its calibration; `cut` shortens the serialised colour image."""
    header = Header(frame_id="camera")
    header.stamp.sec = 7
    colour = conversions.image_to_message(np.zeros((48, 64, 3), np.uint8), "rgb8", header)
    depth = conversions.image_to_message(np.ones((48, 64), np.uint16), "16UC1", header)
    info = conversions.camera_to_message(PinholeCamera(64, 48, 50.0, 50.0, 31.5, 23.5), header)
    plugin = StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP
    typestore = cell_typestore()
    with Writer(path, version=9, storage_plugin=plugin) as writer:

        def add(topic: str, kind: str, data: bytes) -> None:
            connection = writer.add_connection(
                topic, f"sensor_msgs/msg/{kind}", typestore=typestore
            )
            writer.write(connection, 7_000_000_000, data)

        add(TOPICS.info, "CameraInfo", serialised(info))
        add(TOPICS.color, "Image", serialised(colour)[: 40 if cut else None])
        if with_depth:
            add(TOPICS.depth, "Image", serialised(depth))
    return path


@pytest.mark.parametrize("sqlite", [False, True])
def test_both_storages_give_the_same_messages(tmp_path, sqlite) -> None:
    """Kinds and stamps are those that were written, in mcap and in sqlite3."""
    with BagReader(write_bag(tmp_path / "bag", sqlite=sqlite), TOPICS) as reader:
        messages = list(reader.messages())
    assert sorted(message.kind for message in messages) == ["color", "depth", "info"]
    assert {message.stamp for message in messages} == {7_000_000_000}


def test_a_bag_without_depth_is_refused(tmp_path) -> None:
    """The error names the missing topic, what there is, and the option."""
    bag = write_bag(tmp_path / "bag", with_depth=False)
    with pytest.raises(InvalidInputError, match=r"depth.*color/image_raw.*--depth"):
        BagReader(bag, TOPICS).__enter__()


def test_a_cut_message_is_reported_and_the_next_ones_still_come(tmp_path) -> None:
    """A message that cannot be decoded carries its error."""
    with BagReader(write_bag(tmp_path / "bag", cut=True), TOPICS) as reader:
        messages = {message.kind: message for message in reader.messages()}
    assert messages["color"].error
    assert not messages["depth"].error


@pytest.mark.parametrize("name", ["nothing", "file"])
def test_what_is_no_bag_is_refused(tmp_path, name) -> None:
    """A missing path and a foreign file are the user's error."""
    (tmp_path / "file").write_text("no bag")
    with pytest.raises(InvalidInputError, match=name):
        BagReader(tmp_path / name, TOPICS).__enter__()


def test_a_real_bag_without_depth_is_refused() -> None:
    """Bayer images with camera_info but no depth: the error lists the image topics."""
    bag = SHARED / "button_light"
    if not bag.exists():
        pytest.skip(f"{bag} is not here")
    with pytest.raises(InvalidInputError, match="topics of that type"):
        BagReader(bag, TOPICS).__enter__()
