"""Hands above the cloth: taken out of what a cut joined, bridged where they part the cloth."""

from __future__ import annotations

import numpy as np

from emd_perception.candidates import find_things, raised_pixels
from emd_perception.evidence import Evidence
from emd_perception.graph_cut import Hands
from emd_perception.image_types import DepthImage, LabImage, Mask
from emd_perception.mask_morphology import (
    bounding_window,
    dilate,
    label_components,
    opened,
    resize_mask,
)

_LEAST_PART = 0.0004  # square metres; smaller parts are not looked at by themselves
_LIKE_COLOUR = 25.0  # L*a*b* units between the mean colours of two pieces of one cloth
_MAX_SAMPLES = 1000  # pixels of which the table's median colour is taken
_ABOVE_CLOTH = 0.015  # metres; a hand's pixels are at least so much higher than the cloth's


def intruding_parts(outline: Mask, evidence: Evidence, tall: Mask) -> Mask:
    """What a cut has joined with the cloth though it lies high: hands, the robot."""
    parts = np.zeros_like(outline)
    raised = outline & raised_pixels(evidence)
    for part in find_things(raised, evidence, tall, _LEAST_PART) if raised.any() else ():
        if part.is_intruder():
            parts |= part.mask
    return parts


def pieces_behind_hands(pieces: Mask, cloth: Mask, evidence: Evidence, tall: Mask) -> Mask:
    """Add to the cloth what a hand above it cuts off: pieces beyond the hand of like colour."""
    count, labels = label_components(pieces & ~cloth)
    if count == 1:
        return cloth
    hand = dilate(tall | (raised_pixels(evidence) & ~cloth), 5)
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


def outline_hands(hands: Mask, height: DepthImage, cloth_height: float) -> Hands | None:
    """Outline hands at full resolution by their height.

    Args:
        hands: Roughly where they are, shape (h, w), reduced.
        height: Height above the table, shape (H, W), metres, NaN where unknown.
        cloth_height: Median of the cloth, metres.

    Returns:
        None if there are none.
    """
    if not hands.any():
        return None
    near = resize_mask(dilate(hands, 7), height.shape)
    window = bounding_window(near, 1)
    pixels = np.zeros_like(near)
    pixels[window] = near[window] & dilate(height[window] > cloth_height + _ABOVE_CLOTH, 3)
    return Hands(pixels, near)


def painted_over(lab: LabImage, hands: Mask, bare: Mask) -> LabImage:
    """Give hands the table's colour, lest a cloth of the hands' colour count as background.

    Args:
        lab: Shape (h, w, 3).
        hands: Shape (h, w).
        bare: Pixels that look like the table, shape (h, w).
    """
    if not hands.any() or not bare.any():
        return lab
    painted = lab.copy()
    colours = lab[bare]
    painted[dilate(hands, 3)] = np.median(colours[:: -(-len(colours) // _MAX_SAMPLES)], axis=0)
    return painted


def opened_within(mask: Mask, side: int) -> Mask:
    """Remove what is narrower than `side` pixels, but keep the tips of what is wider."""
    return mask & dilate(opened(mask, side), 5)
