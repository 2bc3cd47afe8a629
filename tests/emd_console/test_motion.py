"""Bags of motions, and their replay."""

import numpy as np
import pytest
from fake_cell import HEAD, motion
from rosbags.highlevel import AnyReader

from emd_arm_executor.hiro.description import URDF_PATH
from emd_console.motion import JOINTS, MOTION, PHASE, MotionLog, MotionMessage
from emd_console.replay import read_replay
from emd_console.robot_view import RobotView
from emd_core.errors import InvalidInputError


def test_a_motion_is_a_bag_that_any_reader_reads(tmp_path) -> None:
    """In the order in which the messages came, with the figures that the recording tells."""
    figures = motion(seconds=2.0).write(tmp_path)
    with AnyReader([tmp_path / MOTION]) as reader:
        messages = [
            (item.topic, stamp, reader.deserialize(data, item.msgtype))
            for item, stamp, data in reader.messages()
        ]
    assert figures["messages"] == len(messages) == 1 + 101 + 3
    stamps = [stamp for _, stamp, _ in messages]
    assert stamps == sorted(stamps)
    states = [message for topic, _, message in messages if topic == JOINTS]
    assert states[-1].position[states[-1].name.index("LARM_JOINT0")] == 1.0
    phases = [message.data for topic, _, message in messages if topic == PHASE]
    assert phases == ["approach", "carry", "home"]
    assert figures["seconds"] == 2.0
    assert figures["bytes"] == sum(file.stat().st_size for file in (tmp_path / MOTION).iterdir())


def test_what_is_empty_or_too_large_makes_no_bag(tmp_path, monkeypatch) -> None:
    """Rather none than half of one."""
    assert MotionLog().write(tmp_path) is None
    monkeypatch.setattr("emd_console.motion.LARGEST", 1000)
    log = MotionLog()
    for stamp in range(3):
        log.add(MotionMessage("/x", "std_msgs/msg/String", stamp, bytes(400)))
    assert log.write(tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_a_replay_shows_the_robot_where_it_was(tmp_path) -> None:
    """Twenty times a second, the last posture too; phases by the robot's clock."""
    motion(seconds=2.0).write(tmp_path)
    replay = read_replay(tmp_path / MOTION)
    assert replay.times[0] == 0.0 and replay.times[-1] == pytest.approx(2.0)
    assert 35 <= len(replay.times) <= 42 and (np.diff(replay.times) > 0).all()
    view = RobotView(URDF_PATH.read_text())
    assert len(view.shapes) == len(replay.shapes) == replay.poses.shape[1]
    middle = len(replay.times) // 2
    wanted = view.poses({**HEAD, "LARM_JOINT0": replay.times[middle] / 2.0})
    assert np.allclose(replay.poses[middle], wanted, atol=1e-5)
    assert [name for _, name in replay.phases] == ["approach", "carry", "home"]
    assert np.allclose([time for time, _ in replay.phases], [0.0, 0.68, 1.34], atol=0.02)
    assert replay.transform_table_to_base is None


def test_a_bag_that_cannot_be_replayed_says_why(tmp_path) -> None:
    """No bag, a damaged one, one without joint states."""
    with pytest.raises(InvalidInputError, match="no readable bag"):
        read_replay(tmp_path / MOTION)
    log = MotionLog()
    log.enter("carry", 0)
    log.write(tmp_path)
    with pytest.raises(InvalidInputError, match="joint_states"):
        read_replay(tmp_path / MOTION)
    (tmp_path / MOTION / "motion.mcap").write_bytes(b"nonsense")
    with pytest.raises(InvalidInputError, match="no readable bag"):
        read_replay(tmp_path / MOTION)
