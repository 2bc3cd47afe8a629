"""Perception of frame after frame: what one frame teaches of the table serves the next."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from emd_core.errors import NoClothError
from emd_core.frames import FieldOfView, FloatArray
from emd_perception.config import PerceptionConfig
from emd_perception.frame_input import Frame
from emd_perception.pipeline import Perception, perceive_frames
from emd_perception.stream_memory import StreamMemory
from emd_perception.table_search import find_table
from emd_perception.table_watch import TableWatch


class PerceptionSession:
    """Perceives frames with the extrinsics of the table as it was followed so far.

    Threads may share it; one perceives at a time.
    """

    def __init__(self, watch: TableWatch) -> None:
        """Take who keeps an eye on the table."""
        self.watch = watch
        self._lock = threading.Lock()
        self._memory: StreamMemory | None = None
        self._remembered_for: tuple[PerceptionConfig, FieldOfView | None] | None = None

    def perceive(
        self,
        frames: Sequence[Frame],
        published: FloatArray | None,
        stamp: float,
        config: PerceptionConfig | None = None,
        field_of_view: FieldOfView | None = None,
        streaming: bool = False,
    ) -> Perception:
        """Perceive the cloth in frames of a scene at rest.

        Args:
            frames: In order of time, at least one.
            published: transform_camera_to_table, shape (4, 4), if somebody tells it.
            stamp: Of the last frame, seconds.
            config: Settings; the defaults if None.
            field_of_view: Box of the voxel grid. Without extrinsics there is no cell to keep to,
                and the box may grow to the cloth.
            streaming: Whether what the last streamed frame left serves this one; else it is
                perceived as if it were the first.

        Raises:
            CellError: See `emd_perception.pipeline.perceive_frames`.
        """
        settings = config or PerceptionConfig()
        with self._lock:
            extrinsics = self.watch.extrinsics(published, stamp)
            try:
                perception = perceive_frames(
                    [frame.colour for frame in frames],
                    [frame.depth for frame in frames],
                    frames[-1].camera,
                    extrinsics,
                    settings,
                    None if extrinsics is None else field_of_view,
                    self._remembered((settings, field_of_view)) if streaming else None,
                )
            except NoClothError:
                self._measure_bare_table(frames[-1], extrinsics, stamp, settings)
                raise
            self.watch.measured(perception.table_plane, frames[-1].camera, stamp)
            if streaming:
                self._memory = perception.memory
                self._remembered_for = (settings, field_of_view)
            return perception

    def _remembered(
        self, settings: tuple[PerceptionConfig, FieldOfView | None]
    ) -> StreamMemory | None:
        """What the last streamed frame left, if it was perceived with the same settings."""
        return self._memory if self._remembered_for == settings else None

    def _measure_bare_table(
        self, frame: Frame, extrinsics: FloatArray | None, stamp: float, config: PerceptionConfig
    ) -> None:
        """The table is watched also while no cloth lies on it."""
        if extrinsics is not None:
            plane = find_table(frame.depth, frame.camera, extrinsics, config.plane)
            self.watch.measured(plane.coefficients, frame.camera, stamp)
