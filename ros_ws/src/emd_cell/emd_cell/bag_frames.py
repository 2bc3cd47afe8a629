"""The frames of a bag, without any node."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from emd_cell.bag_reader import BagMessage, BagReader, BagTopics
from emd_core.errors import CellError
from emd_core.pair_matcher import PairMatcher
from emd_perception.frame_input import DepthSource, Frame, InputConfig
from emd_perception.ros.frame_decoder import FrameDecoder

PAIR_TOLERANCE = 20_000_000  # ns between colour and depth of one moment


def required_topics(config: InputConfig) -> tuple[str, ...]:
    """Otherwise optional topics that an input needs."""
    return ("depth_info",) if config.source is DepthSource.UNREGISTERED else ()


def bag_frames(bag: Path, topics: BagTopics, config: InputConfig) -> Iterator[Frame | str]:
    """Decode a bag's pairs of images one after the other.

    Yields:
        A frame, or why a message or pair gives none.

    Raises:
        InvalidInputError: If the bag or its topics cannot be read.
    """
    matcher = PairMatcher[BagMessage](("color", "depth"), PAIR_TOLERANCE)
    decoder = FrameDecoder(config)
    with BagReader(bag, topics, required_topics(config)) as reader:
        # A bag may hold images from before the first calibration.
        latest = {kind: reader.first(kind) for kind in ("info", "depth_info")}
        known = {
            kind: None if first is None else reader.decode(first) for kind, first in latest.items()
        }
        for message in reader.messages("color", "depth", "info", "depth_info"):
            if message.error:
                yield f"{message.kind} message cannot be decoded: {message.error}"
            elif message.kind in known:
                known[message.kind] = reader.decode(message)
            else:
                pair = matcher.add(message.kind, message.stamp, message)
                if pair is None:
                    continue
                colour, depth = (reader.decode(one) for one in pair)
                try:
                    yield decoder.decode(colour, depth, known["info"], known["depth_info"])
                except CellError as err:
                    yield str(err)
