"""The cloth's mask from a colour image and heights above the table (paper, IV-B)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from emd_core.errors import NoClothError
from emd_perception.candidates import (
    Thing,
    blind_patches,
    choose_cloth,
    find_things,
    only_tall_things,
    tall_pixels,
)
from emd_perception.config import SegmentationConfig
from emd_perception.cut_memory import CutMemory
from emd_perception.evidence import Evidence, gather_evidence
from emd_perception.graph_cut import Seeds, cut, refine
from emd_perception.hands import (
    intruding_parts,
    opened_within,
    outline_hands,
    painted_over,
    pieces_behind_hands,
)
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, Mask
from emd_perception.mask_morphology import (
    bounding_window,
    component_sums,
    dilate,
    erode,
    label_components,
    resize_mask,
)
from emd_perception.quality import Judgement, combine, good
from emd_perception.seeding import seed_cut

_FRINGE = 0.3  # of a thing's outline at something tall: it is a part of that
_MIN_KEPT_SHARE = 0.4  # of the seeds; a cut that keeps less has found something else


@dataclass(frozen=True)
class Segmentation:
    """The cloth in a colour image.

    Attributes:
        mask: Shape (H, W).
        area: Square metres on the table.
        judgements: How far to trust it, and why.
        memory: For the next frame.
        hiding: Pixels of hands and other things that may hide cloth, shape (H, W).
    """

    mask: Mask
    area: float
    judgements: tuple[Judgement, ...]
    memory: CutMemory
    hiding: Mask


def segment_cloth(
    colour: ColourImage,
    height: DepthImage,
    pixel_area: FloatImage,
    region: Mask,
    config: SegmentationConfig | None = None,
    last: CutMemory | None = None,
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
        last: Of the frame before in a stream. Its colour mixtures are kept while the scene stays
            as it is, which saves learning them; a changed scene is cut as if it were the first.

    Raises:
        NoClothError: If nothing in the region can be cloth.
    """
    settings = config or SegmentationConfig()
    evidence = gather_evidence(colour, height, pixel_area, region, settings)
    tall = tall_pixels(evidence, settings)
    blind = blind_patches(evidence, tall, settings.min_area)
    seeds, chosen = seed_cut(evidence, tall, blind, settings)
    picture = painted_over(evidence.lab, tall | blind, evidence.region & ~evidence.unlike_table)
    kept = last if last is not None and last.still_holds(evidence.lab, evidence.region) else None
    first_cut, mixtures = cut(picture, seeds, settings, kept.mixtures if kept else None)
    intruders = intruding_parts(first_cut, evidence, tall)
    pieces = opened_within(first_cut & ~dilate(intruders, 3), 3)
    outline = _piece_at(pieces, chosen.mask)
    things = find_things(outline, evidence, tall, settings.min_area)
    if not things:
        raise _no_outline(chosen)
    cloth = choose_cloth(things, settings)
    whole = pieces_behind_hands(pieces, cloth.mask, evidence, tall | blind)
    if whole[chosen.mask].mean() < _MIN_KEPT_SHARE:
        raise _no_outline(chosen)
    judgements = _judge(cloth, seeds, evidence, settings)
    quality, reason = combine(judgements)
    if quality < settings.min_quality:
        raise NoClothError(
            f"what differs most from the table does not look like cloth (quality {quality:.2f}): "
            f"{reason}; put the cloth into view"
        )
    hands = outline_hands(intruders | tall, height, cloth.median_height)
    mask = refine(colour, whole, mixtures, settings, hands) & region
    window = bounding_window(mask, 1)
    pieces = _pieces_near(mask[window], resize_mask(whole, mask.shape)[window])
    mask[window] = _fill_holes(pieces, pixel_area[window], height[window], settings)
    memory = kept or CutMemory(evidence.lab, mixtures)
    hiding = np.zeros_like(mask) if hands is None else hands.pixels & ~mask
    if blind.any():
        hiding |= resize_mask(blind, mask.shape) & ~mask
    area = float(pixel_area[window][mask[window]].sum())
    return Segmentation(mask, area, judgements, memory, hiding)


def _no_outline(chosen: Thing) -> NoClothError:
    """The refusal where the cut has kept too little of what the seeds took for cloth."""
    if chosen.tall_share > _FRINGE:
        return only_tall_things(1)
    return NoClothError(
        "what differs from the table has no outline in the colour image that holds together; "
        "light the table evenly, or use a cloth of another colour than the table"
    )


def _pieces_near(mask: Mask, guide: Mask) -> Mask:
    """The connected pieces of a mask that share a good part of their pixels with a guide."""
    count, labels = label_components(mask)
    if count == 2 and 2 * np.count_nonzero(mask & guide) > np.count_nonzero(mask):
        return mask  # one piece
    size, shared = component_sums(labels, count, np.ones(mask.shape, np.float32), guide)
    near = shared > 0.5 * size
    near[0] = False
    return near[labels]


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
    if count == 2:
        return mask  # nothing but what lies around it
    areas, tall = component_sums(labels, count, pixel_area, height > config.max_height)
    hole = (areas < config.max_hole_area) & (tall == 0)
    hole[0] = False
    return mask | hole[labels]


def _judge(
    cloth: Thing, seeds: Seeds, evidence: Evidence, config: SegmentationConfig
) -> tuple[Judgement, ...]:
    """Judge contrast, completeness and plausibility of the cloth's outline."""
    around = dilate(cloth.mask, 7) & evidence.region & ~dilate(cloth.mask, 3)
    inside = float(evidence.unlike_table[cloth.mask].mean())
    outside = float(1.0 - seeds.cloth[around].mean()) if around.any() else 0.0
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
