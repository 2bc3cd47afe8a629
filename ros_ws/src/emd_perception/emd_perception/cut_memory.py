"""What a cut leaves for the next frame of a stream."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_perception.colour_mixtures import ColourMixtures
from emd_perception.image_types import LabImage, Mask

_CHANGE = 8.0  # L*a*b* units by which a pixel must change to count
_CHANGED_SHARE = 0.02  # of the region; with more the mixtures are learnt anew


@dataclass(frozen=True)
class CutMemory:
    """Colour mixtures and the picture that they were learnt from.

    Attributes:
        lab: Reduced picture, shape (h, w, 3), CIE L*a*b*.
        mixtures: Learnt from it.
    """

    lab: LabImage
    mixtures: ColourMixtures

    def still_holds(self, lab: LabImage, region: Mask) -> bool:
        """Whether a later picture shows the same scene in the same light.

        It is compared with the picture of the learning, not with the last one, so that slow
        changes add up and end in learning anew.

        Args:
            lab: The later picture, shape (h, w, 3).
            region: Pixels of interest, shape (h, w).
        """
        if lab.shape != self.lab.shape or not region.any():
            return False
        difference = lab - self.lab
        squared = np.einsum("vui,vui->vu", difference, difference)
        changed = np.count_nonzero((squared > _CHANGE**2) & region)
        return int(changed) <= _CHANGED_SHARE * int(np.count_nonzero(region))
