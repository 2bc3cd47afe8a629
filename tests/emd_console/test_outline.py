"""Outlines of the cloth's mask."""

import cv2
import numpy as np

from emd_console.outline import mask_outlines


def test_filling_the_outlines_gives_the_mask_back() -> None:
    """Pieces and holes are both traced, to the tolerance."""
    mask = np.zeros((200, 300), dtype=np.uint8)
    cv2.rectangle(mask, (40, 30), (200, 170), 255, -1)
    cv2.circle(mask, (120, 100), 25, 0, -1)
    cv2.circle(mask, (260, 60), 20, 255, -1)
    filled = np.zeros_like(mask)
    cv2.fillPoly(filled, [np.array(polygon) for polygon in mask_outlines(mask)], 255)
    assert ((filled > 0) != (mask > 0)).mean() < 0.01


def test_the_largest_piece_comes_first_and_specks_are_left_out() -> None:
    """Order and limit by area."""
    mask = np.zeros((100, 100), dtype=np.uint8)
    mask[5:8, 5:8] = mask[20:40, 20:40] = mask[50:95, 50:95] = 255
    first, second = mask_outlines(mask)
    assert min(first)[0] >= 50 and min(second)[0] >= 20


def test_an_empty_mask_has_no_outline() -> None:
    """Nothing is drawn."""
    assert mask_outlines(np.zeros((10, 10), dtype=np.uint8)) == []
