"""Whether the camera still sees what it saw: a comparison of reduced frames."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from emd_perception.block_means import reduce_colour, reduce_known
from emd_perception.evidence import reduced_shape
from emd_perception.image_types import ColourImage, DepthImage, FloatImage

# Of reduced, smoothed pixels. A hem that moves by a pixel of the camera changes a quarter of the
# contrast of a reduced pixel beside it.
_CHANGED_COLOUR = 6  # levels of 255
_CHANGED_DEPTH = 0.005  # metres
_WHOLE = 0.999  # share known; at outlines depth comes and goes, and what is left says little
_FEW = 6  # pixels that noise may change


@dataclass(frozen=True)
class Glance:
    """A frame, reduced until noise averages out.

    Attributes:
        colour: Shape (h, w, 3), RGB uint8.
        depth: Sums of the known depths, metres a pixel, shape (h, w).
        known: Share of the pixels with a depth, shape (h, w).
        size: Rows and columns of the frame itself.
    """

    colour: ColourImage
    depth: FloatImage
    known: FloatImage
    size: tuple[int, ...]

    @classmethod
    def of(cls, colour: ColourImage, depth: DepthImage, pixels: int) -> Glance:
        """Reduce a frame to about so many pixels.

        Args:
            colour: Shape (H, W, 3), RGB uint8.
            depth: Shape (H, W), metres, NaN where unknown.
            pixels: Of the reduced picture.
        """
        shape = reduced_shape(depth.shape, pixels)
        smooth = cv2.GaussianBlur(reduce_colour(colour, shape), (3, 3), 0)
        return cls(np.asarray(smooth, np.uint8), *reduce_known(depth, shape), depth.shape)

    def shows_same(self, other: Glance) -> bool:
        """Whether two frames differ by no more than noise does, in colour and in depth.

        Where a depth is missing, colour alone tells. A change of the light is a change, too.
        """
        if self.size != other.size or self.colour.shape != other.colour.shape:
            return False
        difference = cv2.absdiff(self.colour, other.colour)
        changed = (difference > _CHANGED_COLOUR).any(axis=2)
        whole = np.minimum(self.known, other.known) > _WHOLE
        changed |= whole & (np.abs(self.depth - other.depth) > _CHANGED_DEPTH)
        return int(np.count_nonzero(changed)) <= _FEW
