"""Hands frames from the executor's thread to the working ones; newest kept, nothing queued."""

from __future__ import annotations

import threading
import time

from emd_core.errors import DeadlineError
from emd_perception.ros.frame_pair import FramePair


class FrameBuffer:
    """Holds the newest pair for the stream, and collects pairs for a capture."""

    def __init__(self) -> None:
        """Start empty."""
        self._condition = threading.Condition()
        self._newest: FramePair | None = None
        self._collected: list[FramePair] | None = None
        self._uncalibrated: FramePair | None = None
        self._since = 0.0
        self.dropped = 0

    @property
    def collecting(self) -> bool:
        """Whether a capture is waiting for frames."""
        return self._collected is not None

    def add(self, pair: FramePair) -> None:
        """Take a pair; one that the stream has not taken yet is dropped for it."""
        with self._condition:
            self.dropped += self._newest is not None
            self._newest = pair
            if self._collected is not None and pair.stamp >= self._since:
                if pair.info is None:
                    self._uncalibrated = pair
                else:
                    self._collected.append(pair)
            self._condition.notify_all()

    def take(self, timeout: float) -> FramePair | None:
        """Wait for the newest pair; None if none has come within `timeout` seconds."""
        with self._condition:
            self._condition.wait_for(lambda: self._newest is not None, timeout=timeout)
            pair, self._newest = self._newest, None
            return pair

    def collect(self, count: int, since: float, timeout: float) -> list[FramePair]:
        """Wait for pairs taken at or after a time.

        At the start of a cell a calibration may come later than the first images. Pairs without
        one do not count; if no others have come when time is up, one of them is given alone.

        Args:
            count: How many pairs.
            since: Earliest stamp, seconds of the frames' clock.
            timeout: Seconds of the wall clock.

        Raises:
            DeadlineError: If they do not come in time.
        """
        deadline = time.monotonic() + timeout
        with self._condition:
            self._collected, self._uncalibrated, self._since = [], None, since
            try:
                while len(self._collected) < count:
                    if not self._condition.wait(timeout=deadline - time.monotonic()):
                        if self._uncalibrated and not self._collected:
                            return [self._uncalibrated]
                        raise DeadlineError(
                            f"{count} frames of colour and depth were wanted within {timeout:.1f}"
                            f" s, {len(self._collected)} came; is the camera on, and do its "
                            "stamps agree with this clock?"
                        )
                return self._collected[:count]
            finally:
                self._collected = self._uncalibrated = None
