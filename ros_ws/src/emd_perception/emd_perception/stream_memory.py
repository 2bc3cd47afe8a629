"""What a frame of a stream leaves for the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.frames import FloatArray
from emd_perception.glance import Glance
from emd_perception.image_types import Mask
from emd_perception.segmentation import Segmentation
from emd_perception.table_plane import TablePlane

_MOVED_CAMERA = 2e-3  # of an entry of its pose; less is the table's tracking


@dataclass(frozen=True)
class FoundOutline:
    """The cloth's outline, and what was looked at to find it.

    Attributes:
        table: Where the table is, roughly.
        region: Pixels in which cloth was looked for, shape (H, W).
        segmentation: What was found.
    """

    table: TablePlane
    region: Mask
    segmentation: Segmentation


@dataclass(frozen=True)
class StreamMemory:
    """An outline, and when it holds for a later frame too.

    Attributes:
        outline: The last one that was looked for.
        glance: At the frame in which it was found.
        transform_camera_to_table: Extrinsics told at that time, shape (4, 4), if any.
        uses: Frames that the outline has served since.
    """

    outline: FoundOutline
    glance: Glance
    transform_camera_to_table: FloatArray | None
    uses: int = 0

    def still_holds(
        self, glance: Glance, transform_camera_to_table: FloatArray | None, most_uses: int
    ) -> bool:
        """Whether a later frame shows the same, and the outline has not served long enough.

        Frames are compared with the one in which the outline was found, not with the last one, so
        that slow changes add up.
        """
        return (
            self.uses < most_uses
            and _same_place(self.transform_camera_to_table, transform_camera_to_table)
            and self.glance.shows_same(glance)
        )


def _same_place(one: FloatArray | None, other: FloatArray | None) -> bool:
    if one is None or other is None:
        return one is other
    return bool(np.abs(one - other).max() < _MOVED_CAMERA)
