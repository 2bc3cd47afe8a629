"""Which connected thing on the table is the cloth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from emd_core.errors import NoClothError
from emd_perception.config import SegmentationConfig
from emd_perception.evidence import Evidence
from emd_perception.image_types import Mask
from emd_perception.mask_morphology import (
    bounding_window,
    component_sums,
    convex_hull,
    dilate,
    erode,
    label_components,
    opened,
)

_LOW = 0.025  # metres; cloth lies lower in the median, a hand or a box does not
CLEARLY_RAISED = 3.0  # spreads above the table
_ARM = 0.045  # metres; beside something tall, what is higher than this belongs to it
_CUT_OFF_SHARE = 0.04  # of the outline; with more on the region's rim, a thing reaches out of it
_FAR = 100.0  # metres; stands for an unknown height


@dataclass(frozen=True)
class Thing:
    """A connected set of pixels that differ from the table.

    Attributes:
        mask: Shape (h, w).
        area: Square metres on the table.
        solidity: Its pixels as a share of their convex hull, 0..1.
        rim_share: Share of its outline that lies on the rim of the region, 0..1.
        tall_share: Share of its outline beside something taller than any cloth, 0..1.
        median_height: Metres above the table; 0 where no depth is known.
    """

    mask: Mask
    area: float
    solidity: float
    rim_share: float
    tall_share: float
    median_height: float

    def is_intruder(self) -> bool:
        """Whether it lies high and belongs to something taller or reaches in from outside."""
        reaches_in = max(self.tall_share, self.rim_share) > _CUT_OFF_SHARE
        return self.median_height > _LOW and reaches_in

    def score(self) -> float:
        """Area, less for ragged things and for such that the region's rim cuts off."""
        return self.area * (0.4 + 0.6 * self.solidity) * (1.0 - 0.8 * self.rim_share)


def tall_pixels(evidence: Evidence, config: SegmentationConfig) -> Mask:
    """Pixels too high for cloth, and what is high beside them: hands, boxes."""
    tall = opened(evidence.height > config.max_height, 3)
    labels = label_components(evidence.height > max(_ARM, 0.5 * config.max_height))[1]
    belongs = np.zeros(int(labels.max()) + 1, dtype=bool)
    belongs[labels[tall]] = True
    belongs[0] = False
    return np.asarray(belongs[labels])


def raised_pixels(evidence: Evidence) -> Mask:
    """Pixels higher than most cloth lies: piles, hands, the robot's pedestal."""
    return np.asarray(evidence.height > _LOW)


def blind_patches(evidence: Evidence, tall: Mask, min_area: float) -> Mask:
    """Wide patches without any depth, where cloth with a depth is in view: things too near.

    Without such cloth nothing is left out: it may be black to infrared light itself.
    """
    raised = evidence.region & ~tall & opened(evidence.rise > CLEARLY_RAISED, 3)
    if evidence.pixel_area[raised].sum() < min_area:
        return np.zeros_like(tall)
    return dilate(opened(~np.isfinite(evidence.height), 7), 3)


def height_steps(evidence: Evidence, config: SegmentationConfig) -> Mask:
    """Pixels at a jump of height that no fold makes."""
    known = np.isfinite(evidence.height)
    square = np.ones((3, 3), np.uint8)
    low = cv2.erode(np.where(known, evidence.height, _FAR).astype(np.float32), square)
    high = cv2.dilate(np.where(known, evidence.height, -_FAR).astype(np.float32), square)
    return np.asarray(np.subtract(high, low) > config.max_height_step)


def find_things(seeds: Mask, evidence: Evidence, tall: Mask, min_area: float) -> list[Thing]:
    """Describe the connected things among the seed pixels that are at least `min_area` large."""
    count, labels = label_components(seeds)
    areas, _ = component_sums(labels, count, evidence.pixel_area, seeds)
    large = [label for label in range(1, count) if areas[label] >= min_area]
    if not large:
        return []
    beside_tall = dilate(tall, 5)
    return [
        _describe(labels == label, float(areas[label]), evidence, beside_tall) for label in large
    ]


def only_tall_things(count: int) -> NoClothError:
    """The refusal where all that differs from the table stands too high for cloth."""
    return NoClothError(
        f"{count} thing(s) on the table, none of them cloth: all lie {1e3 * _LOW:.0f} mm or more "
        "above the table and belong to something taller or reach in from outside; take them away "
        "and put the cloth into view"
    )


def choose_cloth(things: list[Thing], config: SegmentationConfig) -> Thing:
    """Pick the largest thing that can be cloth.

    Raises:
        NoClothError: If there is none; the text says what was there instead.
    """
    if not things:
        raise NoClothError(
            f"nothing of {1e4 * config.min_area:.0f} square cm or more differs from the table; "
            "put the cloth into view, or light the table evenly"
        )
    possible = [thing for thing in things if not thing.is_intruder()]
    if not possible:
        raise only_tall_things(len(things))
    fitting = [thing for thing in possible if thing.area <= config.max_area]
    if not fitting:
        raise NoClothError(
            f"what differs from the table covers {max(t.area for t in possible):.2f} square "
            f"metres, cloth at most {config.max_area:.2f}; does the camera see bare table around "
            "the cloth?"
        )
    return max(fitting, key=Thing.score)


def _describe(mask: Mask, area: float, evidence: Evidence, beside_tall: Mask) -> Thing:
    window = bounding_window(mask, 1)
    part = mask[window]
    outline = part & ~erode(part, 3)
    length = max(1, int(np.count_nonzero(outline)))
    heights = evidence.height[window][part]
    heights = heights[np.isfinite(heights)]
    hull = np.count_nonzero(convex_hull(part))
    return Thing(
        mask=mask,
        area=area,
        solidity=float(np.count_nonzero(part) / hull),
        rim_share=float(np.count_nonzero(outline & evidence.rim[window]) / length),
        tall_share=float(np.count_nonzero(outline & beside_tall[window]) / length),
        median_height=float(np.median(heights)) if len(heights) else 0.0,
    )
