"""Plays a bag through the perception node, frame by frame, and keeps what it makes of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from emd_cell.bag_frames import PAIR_TOLERANCE, required_topics
from emd_cell.bag_reader import BagMessage, BagReader, BagTopics
from emd_cell.replay_clock import ReplayClock
from emd_cell.replay_summary import ContactSheet, ReplaySummary
from emd_cell.ros.replay_client import CALIBRATIONS, Answer, ReplayClient
from emd_core.errors import CellError, DeadlineError
from emd_core.pair_matcher import PairMatcher
from emd_core.ros import conversions
from emd_perception.frame_input import InputConfig


class BagReplay:
    """Plays every pair of a bag; perception answers one before it gets the next."""

    def __init__(
        self, client: ReplayClient, out: Path, rate: float, check: Callable[[], None]
    ) -> None:
        """Prepare.

        Args:
            client: Talks to perception.
            out: Folder for grids, summary.json, report.md and contact_sheet.png.
            rate: Recorded seconds a second; 0: as fast as perception answers.
            check: Raises if perception is gone.

        Raises:
            InvalidInputError: If the rate is negative or not finite.
        """
        self._client, self._out, self._check = client, out, check
        self._clock = ReplayClock(rate)
        self._rate = rate
        self._sheet = ContactSheet()
        self._matcher = self._new_matcher()
        self._played: set[int] = set()

    def run(
        self,
        bag: Path,
        topics: BagTopics,
        config: InputConfig,
        on_frame: Callable[[ReplaySummary], None],
    ) -> ReplaySummary:
        """Play a bag and write what became of it.

        Raises:
            InvalidInputError: If the bag or its topics cannot be read.
        """
        summary = ReplaySummary(str(bag), self._rate)
        begun = time.monotonic()
        with BagReader(bag, topics, required_topics(config)) as reader:
            self._out.mkdir(parents=True, exist_ok=True)
            for kind in CALIBRATIONS:  # a bag may hold images from before the first of them
                known = reader.first(kind)
                if known is not None:
                    self._client.remember(known)
            for message in reader.messages():
                self._take(message, reader, summary)
                on_frame(summary)
        summary.unpaired += self._matcher.unpaired + self._matcher.waiting
        summary.recorded_seconds = self._clock.recorded
        summary.seconds = time.monotonic() - begun
        self._sheet.write(self._out / "contact_sheet.png")
        summary.write(self._out)
        return summary

    def _take(self, message: BagMessage, reader: BagReader, summary: ReplaySummary) -> None:
        if message.error:
            reason = f"{message.kind} message cannot be decoded: {message.error}"
            summary.skip(message.stamp, reason)
        elif message.kind in CALIBRATIONS:
            self._client.remember(message)
        else:
            pair = self._matcher.add(message.kind, message.stamp, message)
            if pair is not None:
                self._play(*pair, reader, summary)

    def _play(
        self, color: BagMessage, depth: BagMessage, reader: BagReader, summary: ReplaySummary
    ) -> None:
        jump = self._clock.pass_to(color.stamp)
        if jump:
            summary.clock_jumps.append({"stamp": color.stamp, "seconds": jump})
            summary.unpaired += self._matcher.unpaired + self._matcher.waiting
            self._matcher = self._new_matcher()
        if color.stamp in self._played:
            summary.skip(color.stamp, "an image with this stamp was played before")
            return
        self._played.add(color.stamp)
        index = summary.frames
        summary.frames += 1
        try:
            answer = self._client.play_pair(color, depth, self._check)
        except DeadlineError as err:
            summary.skip(color.stamp, str(err))
            return
        if answer.grid is None:
            summary.skip(color.stamp, answer.verdict["reason"])
        else:
            self._keep(color.stamp, index, answer, summary)
        if self._sheet.wants_next:
            self._show(color, index, answer, reader)
        else:
            self._sheet.add(None, None, None, "")

    def _keep(self, stamp: int, index: int, answer: Answer, summary: ReplaySummary) -> None:
        assert answer.grid is not None
        file = f"voxel_grid_{index:06d}.npz"
        answer.grid.save(self._out / file)
        summary.grids.append(
            {
                "file": file,
                "stamp": stamp,
                "occupied_voxels": int(answer.grid.occupancy.sum()),
                "quality": float(answer.verdict["quality"]),
                "reason": answer.verdict["reason"],
            }
        )

    def _show(self, color: BagMessage, index: int, answer: Answer, reader: BagReader) -> None:
        try:
            picture = conversions.rgb_from_message(reader.decode(color))
        except CellError:  # perception has refused it for the same reason
            picture = None
        verdict = answer.verdict
        said = f"quality {verdict['quality']}" if "quality" in verdict else verdict["reason"]
        caption = f"{index}: {self._clock.recorded:.2f} s, {said}"
        self._sheet.add(picture, answer.mask, answer.grid, caption)

    def _new_matcher(self) -> PairMatcher[BagMessage]:
        return PairMatcher(("color", "depth"), PAIR_TOLERANCE)
