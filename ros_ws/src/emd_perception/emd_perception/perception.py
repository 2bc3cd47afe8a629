"""What perception tells about the cloth."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_core.voxel_grid import VoxelGrid
from emd_perception.image_types import ColourImage, Mask
from emd_perception.stream_memory import StreamMemory


@dataclass(frozen=True)
class Perception:
    """What was seen of the cloth.

    Attributes:
        mask: The cloth's pixels, shape (H, W).
        quality: How far to trust it, 0..1.
        reason: What lowers the quality, worst first; "cloth found" if nothing does.
        table_plane: Measured table, shape (4,): a, b, c, d in the camera optical frame, metres;
            unit normal towards the camera.
        transform_camera_to_table: Shape (4, 4), metres; z = 0 is the measured table.
        points_in_table: The cloth's surface, averaged and cleaned, shape (N, 3), metres.
        colours: Colours of these points, shape (N, 3), RGB uint8.
        voxel_grid: The cloth's state for the network.
        cloth_area: Square metres on the table.
        motion_share: Share of the region that moved between the frames, 0..1.
        notes: Choices that were made for want of better knowledge.
        milliseconds: Time of each stage, and of all as `total`.
        image: The colour image that all this refers to (the mean of several frames).
        memory: For `perceive` of the next frame of a stream.
    """

    mask: Mask
    quality: float
    reason: str
    table_plane: FloatArray
    transform_camera_to_table: FloatArray
    points_in_table: FloatArray
    colours: NDArray[np.uint8]
    voxel_grid: VoxelGrid
    cloth_area: float
    motion_share: float
    notes: tuple[str, ...]
    milliseconds: dict[str, float]
    image: ColourImage = field(repr=False)
    memory: StreamMemory | None = field(default=None, repr=False)
