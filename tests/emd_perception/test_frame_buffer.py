"""Newest kept, nothing queued; a capture gets the frames that it asked for."""

import threading

import pytest
from std_msgs.msg import Header

from emd_core.errors import DeadlineError
from emd_perception.ros.frame_buffer import FrameBuffer
from emd_perception.ros.frame_pair import FramePair


class Image:
    """A message with a stamp."""

    def __init__(self, seconds: int) -> None:
        """Stamp it."""
        self.header = Header()
        self.header.stamp.sec = seconds


def pair(seconds: int, calibration: object | None = "calibration") -> FramePair:
    """Colour and depth of one second."""
    return FramePair(Image(seconds), Image(seconds), calibration)


def test_only_the_newest_pair_waits() -> None:
    """Of three the stream gets the last one; two count as dropped; then there is none."""
    buffer = FrameBuffer()
    for second in range(3):
        buffer.add(pair(second))
    taken = buffer.take(0.0)
    assert taken is not None and taken.stamp == 2.0
    assert buffer.dropped == 2
    assert buffer.take(0.0) is None


def collect_while_adding(
    count: int, since: float, stamps: range, calibrated_from: int = 0, timeout: float = 20.0
) -> list[FramePair]:
    """Ask for pairs in a thread, and let them come once it listens."""
    buffer, found = FrameBuffer(), list[FramePair]()
    thread = threading.Thread(target=lambda: found.extend(buffer.collect(count, since, timeout)))
    thread.start()
    while not buffer.collecting:
        pass
    for second in stamps:
        buffer.add(pair(second, "calibration" if second >= calibrated_from else None))
    thread.join(20.0)
    assert not buffer.collecting
    return found


def test_a_capture_gets_pairs_from_its_time_on() -> None:
    """Those taken before it was asked are not among them."""
    assert [one.stamp for one in collect_while_adding(3, 4.5, range(1, 8))] == [5.0, 6.0, 7.0]


def test_a_capture_waits_for_the_calibration() -> None:
    """Pairs that come before it are left out; the last one is given if no other comes."""
    found = collect_while_adding(2, 0.0, range(5), calibrated_from=3)
    assert [one.stamp for one in found] == [3.0, 4.0]
    found = collect_while_adding(2, 0.0, range(5), calibrated_from=9, timeout=0.2)
    assert [one.stamp for one in found] == [4.0]


def test_a_capture_that_waits_in_vain_says_how_many_came() -> None:
    """None of old stamps is kept meanwhile."""
    buffer = FrameBuffer()
    with pytest.raises(DeadlineError, match="2 frames.*0 came.*stamps"):
        buffer.collect(2, 0.0, 0.05)
    assert not buffer.collecting
