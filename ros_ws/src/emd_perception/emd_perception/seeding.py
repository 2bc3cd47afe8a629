"""Where the cut starts: what differs from the table in colour or height, hands left out."""

from __future__ import annotations

import cv2
import numpy as np

from emd_perception.candidates import (
    CLEARLY_RAISED,
    Thing,
    choose_cloth,
    find_things,
    height_steps,
)
from emd_perception.config import SegmentationConfig
from emd_perception.evidence import Evidence
from emd_perception.graph_cut import Seeds
from emd_perception.image_types import Mask
from emd_perception.mask_morphology import dilate, erode, opened

_REACH = 5  # reduced pixels by which the cut may go beyond the seeds
_FLAT = 1.2  # spreads; and so little is bare table then
_TELLING_SHARE = 0.1  # of a thing that must be raised for height to tell what belongs to it
_TELLING_SPREAD = 0.001  # metres; a sensor that spreads heights more does not tell thin cloth
_EDGE = 0.35  # of the height nearby: smoothing does not carry more beyond an edge
_SMALLER = 0.2  # of the least area; so large are pieces that a hand may have cut off


def seed_cut(
    evidence: Evidence, tall: Mask, blind: Mask, config: SegmentationConfig
) -> tuple[Seeds, Thing]:
    """Turn contrast into seeds; what stands beside the cloth and is none becomes background.

    Args:
        evidence: What each pixel says.
        tall: Pixels of hands and boxes, shape (h, w).
        blind: Pixels of things too near to be measured, shape (h, w).
        config: What counts as cloth.

    Raises:
        NoClothError: If nothing that differs from the table can be cloth.
    """
    unlike = evidence.region & ~tall & evidence.unlike_table & ~blind
    steps = height_steps(evidence, config)
    solid = opened(unlike, 3) & ~steps
    things = find_things(solid, evidence, tall, config.min_area)
    chosen = choose_cloth(things, config)
    told_by_height = height_tells(chosen, evidence, config)
    if told_by_height:
        unlike &= ~lying_flat(evidence)
        solid = opened(unlike, 3) & ~steps
        things = find_things(solid, evidence, tall, _SMALLER * config.min_area)
        chosen = choose_cloth([one for one in things if one.area >= config.min_area], config)
    possible = dilate(chosen.mask, 2 * _REACH + 1)
    surely_not = tall | ~evidence.region | blind
    for thing in things:
        if thing.is_intruder():
            surely_not |= thing.mask
        else:
            possible |= thing.mask
    surely_not |= ~possible
    strong = evidence.contrast > 1.2 * evidence.threshold
    surely_cloth = erode(chosen.mask, 5, outside=True) & strong
    if told_by_height:
        surely_not |= lying_flat(evidence)
        surely_cloth |= chosen.mask & _raised(evidence)
    return Seeds(unlike, surely_cloth & ~surely_not, surely_not), chosen


def height_tells(thing: Thing, evidence: Evidence, config: SegmentationConfig) -> bool:
    """Whether so much of a thing lies clearly above the table that its flat parts are none of it.

    Flat parts of what is told by its height are shadows. Where the sensor's noise hides thin
    cloth, colour alone tells.
    """
    if evidence.rise_spread > _TELLING_SPREAD:
        return False
    raised = thing.mask & opened(evidence.rise > CLEARLY_RAISED, 3)
    area = float(evidence.pixel_area[raised].sum())
    return area > max(config.min_area, _TELLING_SHARE * thing.area)


def _raised(evidence: Evidence) -> Mask:
    """Pixels that lie clearly above the table, up to the edge of what lies there."""
    nearby = cv2.dilate(evidence.rise, np.ones((5, 5), np.uint8))
    return np.asarray(evidence.rise > np.maximum(CLEARLY_RAISED, _EDGE * nearby))


def lying_flat(evidence: Evidence) -> Mask:
    """Pixels that are known to lie on the bare table's level, in patches."""
    return opened(np.isfinite(evidence.height) & (evidence.rise < _FLAT), 3)
