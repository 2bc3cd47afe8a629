"""Bags of ROS 1 and 2, whole and damaged, give the same frames or reasons."""

from pathlib import Path

import numpy as np
import pytest
from bag_files import (
    CAMERA,
    TOPICS,
    Recorded,
    as_ros1,
    calibration_and_pose,
    cloth_scene,
    colour_message,
    header_at,
    pairs,
    recorded,
    write_bag,
)
from perception_scenes import Scene

from emd_cell.bag_frames import bag_frames
from emd_cell.bag_reader import DAMAGE, BagReader
from emd_core.errors import InvalidInputError
from emd_core.ros.point_clouds import points_to_message
from emd_perception.frame_input import Frame, InputConfig

SHARED = Path(__file__).parents[2].parent / "shared" / "data" / "bags"
STAMPS = [10_000_000_000 + index * 33_000_000 for index in range(4)]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A cloth in two noisy frames."""
    return cloth_scene(2)


@pytest.fixture(scope="module")
def bag(scene, tmp_path_factory) -> Path:
    """Calibration, pose and four pairs."""
    messages = [*calibration_and_pose(scene, STAMPS[0]), *pairs(scene, STAMPS)]
    return write_bag(tmp_path_factory.mktemp("bags") / "bag", messages)


def test_frames_are_those_that_were_recorded(bag, scene) -> None:
    """Colour to the bit, depth to the rounding of millimetres, and the camera."""
    frames = list(bag_frames(bag, TOPICS, InputConfig()))
    assert len(frames) == 4
    for number, frame in enumerate(frames):
        assert isinstance(frame, Frame)
        np.testing.assert_array_equal(frame.colour, scene.colour)
        np.testing.assert_allclose(frame.depth, scene.depth_frames[number % 2], atol=6e-4)
        assert frame.camera == CAMERA


def test_a_bag_of_ros_1_gives_the_same_messages(bag, tmp_path) -> None:
    """Converted while it is read: kinds, stamps and every field."""
    old = as_ros1(bag, tmp_path / "old.bag")
    with BagReader(bag, TOPICS) as reader, BagReader(old, TOPICS) as old_reader:
        new, converted = list(reader.messages()), list(old_reader.messages())
        assert [(m.kind, m.stamp) for m in converted] == [(m.kind, m.stamp) for m in new]
        assert not any(message.error for message in converted)
        for one, other in zip(new, converted, strict=True):
            first, second = reader.decode(one), old_reader.decode(other)
            if one.kind == "info":
                np.testing.assert_array_equal(first.k, second.k)
                np.testing.assert_array_equal(first.p, second.p)
            elif one.kind != "pose":
                np.testing.assert_array_equal(first.data, second.data)
            assert first.header.frame_id == second.header.frame_id


def test_a_broken_message_of_ros_1_is_told(bag, tmp_path) -> None:
    """Bytes that end too early in a bag of ROS 1 do not end the others."""
    old = as_ros1(bag, tmp_path / "old.bag")
    data = old.read_bytes()
    place = data.index(b"16UC1")
    old.write_bytes(data[: place - 4] + b"\xff\xff\xff\x7f" + data[place:])
    found = list(bag_frames(old, TOPICS, InputConfig()))
    assert sum(isinstance(item, Frame) for item in found) == 3
    assert (
        sum("depth message cannot be decoded" in item for item in found if isinstance(item, str))
        == 1
    )


@pytest.mark.parametrize("share", [0.4, 0.9, 0.999])
def test_a_bag_that_was_cut_off_gives_an_error_or_what_is_whole(bag, tmp_path, share) -> None:
    """No traceback: refused at once, or read up to the damage, which is told."""
    cut = tmp_path / "cut"
    cut.mkdir()
    for file in bag.iterdir():
        data = file.read_bytes()
        kept = data[: int(share * len(data))] if file.suffix == ".mcap" else data
        (cut / file.name).write_bytes(kept)
    try:
        with BagReader(cut, TOPICS) as reader:
            messages = list(reader.messages())
    except InvalidInputError as err:
        assert "not a readable bag" in str(err)
        return
    assert messages[-1].kind == DAMAGE
    assert "damaged" in messages[-1].error


def test_a_point_cloud_takes_the_place_of_the_depth(scene, tmp_path) -> None:
    """A cloud on the depth topic is accepted and registered."""
    cloud = points_to_message(CAMERA.unproject(scene.depth_frames[0]), header_at(STAMPS[0]))
    bag = write_bag(
        tmp_path / "bag",
        [
            *calibration_and_pose(scene, STAMPS[0]),
            recorded("color", STAMPS[0], colour_message(scene, STAMPS[0])),
            recorded("points", STAMPS[0], cloud),
        ],
    )
    with BagReader(bag, TOPICS) as reader:
        assert reader.has_points
    (frame,) = bag_frames(bag, TOPICS, InputConfig("points"))
    assert isinstance(frame, Frame)
    np.testing.assert_allclose(frame.depth, scene.depth_frames[0], atol=1e-5)


def test_unregistered_depth_needs_its_calibration(bag) -> None:
    """The error names the topic and the option."""
    with pytest.raises(InvalidInputError, match="depth_info.*--depth-info"):
        list(bag_frames(bag, TOPICS, InputConfig("unregistered")))


def test_pairs_that_cannot_be_used_are_told(scene, tmp_path) -> None:
    """Another size, another encoding and a stamp without partner, between good pairs."""
    small = colour_message(scene, STAMPS[1])
    small.width, small.step = 160, 480
    strange = colour_message(scene, STAMPS[2])
    strange.encoding = "yuv422"
    messages = [*calibration_and_pose(scene, STAMPS[0]), *pairs(scene, STAMPS)]
    messages[4] = recorded("color", STAMPS[1], small)
    messages[6] = recorded("color", STAMPS[2], strange)
    messages.insert(9, Recorded("color", 1, messages[2].data[:60]))
    found = list(bag_frames(write_bag(tmp_path / "bag", messages), TOPICS, InputConfig()))
    reasons = [item for item in found if isinstance(item, str)]
    assert len(found) - len(reasons) == 2
    assert any("160 x 240" in reason for reason in reasons)
    assert any("yuv422" in reason for reason in reasons)
    assert any("cannot be decoded" in reason for reason in reasons)


@pytest.mark.parametrize("name", ["button_light", "watercan", "test_bag_mcap", "test_bag_sqlite3"])
def test_bags_of_others_are_refused_with_their_topics(name) -> None:
    """They have no colour with depth; each refusal names what is missing and what there is."""
    if not (SHARED / name).exists():
        pytest.skip(f"needs {SHARED / name}, which is not distributed")
    with pytest.raises(InvalidInputError, match="is needed, but.*topics of that type"):
        list(bag_frames(SHARED / name, TOPICS, InputConfig()))
