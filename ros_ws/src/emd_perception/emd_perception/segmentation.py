"""The cloth's mask from a colour image and heights above the table (paper, IV-B)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from emd_core.errors import NoClothError
from emd_perception.candidates import (
    Thing,
    choose_cloth,
    find_things,
    height_steps,
    raised_pixels,
    tall_pixels,
)
from emd_perception.config import SegmentationConfig
from emd_perception.evidence import Evidence, gather_evidence
from emd_perception.graph_cut import Seeds, cut, refine
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, Mask
from emd_perception.mask_morphology import dilate, erode, label_components, opened, resize_mask
from emd_perception.quality import Judgement, combine, good

_MIN_KEPT_SHARE = 0.4  # of the seeds; a cut that keeps less has found something else
_LEAST_PART = 0.0004  # square metres; smaller parts are not looked at by themselves
_LIKE_COLOUR = 15.0  # L*a*b* units between the mean colours of two pieces of one cloth
_REACH = 6  # reduced pixels by which the cut may go beyond the seeds


@dataclass(frozen=True)
class Segmentation:
    """The cloth in a colour image.

    Attributes:
        mask: Shape (H, W).
        area: Square metres on the table.
        judgements: How far to trust it, and why.
    """

    mask: Mask
    area: float
    judgements: tuple[Judgement, ...]


def segment_cloth(
    colour: ColourImage,
    height: DepthImage,
    pixel_area: FloatImage,
    region: Mask,
    config: SegmentationConfig | None = None,
) -> Segmentation:
    """Find the cloth by GraphCut with automatic seeds (paper, IV-B).

    The paper does not say who seeds its GraphCut. Here the seeds are what differs from the table,
    whose looks are learnt at the rim of the region, in colour or height.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        height: Height above the table, shape (H, W), metres, NaN where unknown.
        pixel_area: Table area that a pixel covers, shape (H, W), square metres.
        region: Pixels of interest, shape (H, W); what lies outside is ignored.
        config: Settings; the defaults if None.

    Raises:
        NoClothError: If nothing in the region can be cloth.
    """
    settings = config or SegmentationConfig()
    evidence = gather_evidence(colour, height, pixel_area, region, settings)
    tall = tall_pixels(evidence, settings)
    seeds, chosen = _seed(evidence, tall, settings)
    first_cut, mixtures = cut(evidence.lab, seeds, settings)
    pieces = _without_intruders(opened(first_cut, 3), evidence, tall)
    outline = _piece_at(pieces, chosen.mask)
    things = find_things(outline, evidence, tall, settings.min_area)
    if not things or outline[chosen.mask].mean() < _MIN_KEPT_SHARE:
        raise NoClothError(
            "what differs from the table has no outline in the colour image that holds together; "
            "light the table evenly, or use a cloth of another colour than the table"
        )
    cloth = choose_cloth(things, settings)
    judgements = _judge(cloth, evidence, settings)
    quality, reason = combine(judgements)
    if quality < settings.min_quality:
        raise NoClothError(
            f"what differs most from the table does not look like cloth (quality {quality:.2f}): "
            f"{reason}; put the cloth into view"
        )
    outline = _behind_hands(pieces, cloth.mask, evidence, tall)
    mask = refine(colour, outline, mixtures, settings) & region
    mask = _pieces_near(mask, resize_mask(outline, mask.shape))
    mask = _fill_holes(mask, pixel_area, height, settings)
    return Segmentation(mask, float(pixel_area[mask].sum()), judgements)


def _seed(evidence: Evidence, tall: Mask, config: SegmentationConfig) -> tuple[Seeds, Thing]:
    """Turn contrast into seeds; what stands beside the cloth and is none becomes background."""
    unlike = evidence.region & ~tall & evidence.unlike_table
    solid = opened(unlike, 3) & ~height_steps(evidence, config)
    things = find_things(solid, evidence, tall, config.min_area)
    chosen = choose_cloth(things, config)
    possible = dilate(chosen.mask, 2 * _REACH + 1)
    intruders = tall.copy()
    for thing in things:
        if thing.is_intruder():
            intruders |= thing.mask
        else:
            possible |= thing.mask
    surely_not = ~evidence.region | ~possible | intruders
    strong = evidence.contrast > 1.2 * evidence.threshold
    surely_cloth = erode(chosen.mask, 5, outside=True) & strong & ~surely_not
    return Seeds(unlike, surely_cloth, surely_not), chosen


def _without_intruders(outline: Mask, evidence: Evidence, tall: Mask) -> Mask:
    """Take away what a cut has joined with the cloth though it lies high: hands, the robot."""
    kept = outline.copy()
    for part in find_things(outline & raised_pixels(evidence), evidence, tall, _LEAST_PART):
        if part.is_intruder():
            kept &= ~dilate(part.mask, 7)
    return opened(kept, 3)


def _behind_hands(pieces: Mask, cloth: Mask, evidence: Evidence, tall: Mask) -> Mask:
    """Add to the cloth what a hand above it cuts off: pieces beyond the hand of like colour."""
    hand = dilate(tall | (raised_pixels(evidence) & ~cloth), 7)
    count, labels = label_components(pieces & ~cloth)
    joined = label_components(cloth | hand)[1]
    at_cloth = np.unique(joined[cloth])
    own = evidence.lab[cloth].mean(axis=0)
    whole = cloth.copy()
    for label in range(1, count):
        piece = labels == label
        touched = np.unique(joined[dilate(piece, 3) & hand])
        alike = np.linalg.norm(evidence.lab[piece].mean(axis=0) - own) < _LIKE_COLOUR
        if evidence.pixel_area[piece].sum() >= _LEAST_PART and alike:
            if np.isin(touched, at_cloth).any():
                whole |= piece
    return whole


def _pieces_near(mask: Mask, guide: Mask) -> Mask:
    """The connected pieces of a mask that share a good part of their pixels with a guide."""
    count, labels = label_components(mask)
    size = np.bincount(labels.ravel(), minlength=count)
    shared = np.bincount(labels[guide], minlength=count)
    near = shared > 0.5 * size
    near[0] = False
    return np.asarray(near[labels])


def _piece_at(mask: Mask, guide: Mask) -> Mask:
    """The connected piece of a mask that shares the most pixels with a guide; may be empty."""
    count, labels = label_components(mask)
    shared = np.bincount(labels[guide], minlength=count)
    shared[0] = 0
    return np.asarray(labels == np.argmax(shared)) & mask


def _fill_holes(
    mask: Mask, pixel_area: FloatImage, height: DepthImage, config: SegmentationConfig
) -> Mask:
    """Fill small holes, but none through which something taller than cloth is seen."""
    count, labels = label_components(~mask, connectivity=4)
    areas = np.bincount(labels.ravel(), weights=pixel_area.ravel(), minlength=count)
    tall = np.bincount(labels[height > config.max_height], minlength=count)
    hole = (areas < config.max_hole_area) & (tall == 0)
    hole[0] = False
    return mask | hole[labels]


def _judge(cloth: Thing, evidence: Evidence, config: SegmentationConfig) -> tuple[Judgement, ...]:
    """Judge contrast, completeness and plausibility of the cloth's outline."""
    around = dilate(cloth.mask, 9) & evidence.region & ~dilate(cloth.mask, 3)
    inside = float(evidence.unlike_table[cloth.mask].mean())
    outside = float(1.0 - evidence.unlike_table[around].mean()) if around.any() else 0.0
    edge = _edge_share(cloth.mask, evidence)
    height = cloth.median_height
    return (
        Judgement(good(inside, 0.5, 0.85), "the cloth's colour is close to the table's"),
        Judgement(good(outside, 0.4, 0.8), "the outline leaves out much that is not table"),
        Judgement(good(edge, 0.3, 0.8), "the outline is no edge of colour or height"),
        Judgement(good(cloth.rim_share, 0.4, 0.04), "the cloth reaches out of view"),
        Judgement(good(cloth.tall_share, 0.8, 0.1), "something tall stands at the cloth"),
        Judgement(
            good(height, config.max_height, 0.03),
            f"it lies {1e3 * height:.0f} mm above the table, more than cloth does",
        ),
        Judgement(good(cloth.solidity, 0.2, 0.4), "its outline is ragged"),
    )


def _edge_share(mask: Mask, evidence: Evidence) -> float:
    """Share of the outline at which the contrast falls steeply, not by fading light."""
    outline = mask & ~erode(mask, 3)
    window = np.ones((7, 7), np.uint8)
    fall = np.subtract(cv2.dilate(evidence.contrast, window), cv2.erode(evidence.contrast, window))
    return float((fall > 0.5 * evidence.threshold)[outline].mean()) if outline.any() else 0.0
