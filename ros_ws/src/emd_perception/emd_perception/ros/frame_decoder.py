"""From a camera's messages to the images that perception takes."""

from __future__ import annotations

from typing import Any

from emd_core.errors import NoObservationError
from emd_core.ros import conversions
from emd_core.ros.point_clouds import organised_points
from emd_perception.depth_image import depth_in_metres
from emd_perception.frame_input import (
    CalibratedCamera,
    DepthSource,
    Frame,
    FrameAligner,
    InputConfig,
)


class FrameDecoder:
    """Decodes messages of rclpy or of rosbags; keeps its tables while the calibration stays."""

    def __init__(self, config: InputConfig) -> None:
        """Take what the camera gives."""
        self.config = config
        self._known: tuple[CalibratedCamera, CalibratedCamera | None] | None = None
        self._aligner: FrameAligner | None = None

    def decode(self, colour: Any, depth: Any, info: Any, depth_info: Any = None) -> Frame:
        """Decode a pair.

        Args:
            colour: Image.
            depth: Image, or PointCloud2 where the config says points.
            info: CameraInfo of the colour camera.
            depth_info: CameraInfo of the depth camera; needed if depth is unregistered.

        Raises:
            InvalidInputError: If a message is not as wanted or they do not fit together.
            NoObservationError: If a calibration is missing.
        """
        own = self.config.source is DepthSource.UNREGISTERED
        if info is None or (own and depth_info is None):
            missing = "colour" if info is None else "depth"
            raise NoObservationError(
                f"images came, but no calibration of the {missing} camera; publish its camera_info"
            )
        aligner = self._aligner_for(info, depth_info)
        straight = aligner.colour(conversions.rgb_from_message(colour))
        if self.config.source is DepthSource.POINTS:
            metres = aligner.depth_of_points(organised_points(depth))
        else:
            raw = conversions.image_from_message(depth)
            metres = aligner.depth(depth_in_metres(raw, encoding=depth.encoding))
        return Frame(straight, metres, aligner.camera)

    def _aligner_for(self, info: Any, depth_info: Any) -> FrameAligner:
        own = self.config.source is DepthSource.UNREGISTERED and depth_info is not None
        cameras = (_camera(info), _camera(depth_info) if own else None)
        if self._aligner is None or cameras != self._known:
            self._aligner, self._known = FrameAligner(self.config, *cameras), cameras
        return self._aligner


def _camera(info: Any) -> CalibratedCamera:
    camera = conversions.camera_from_message(info)
    return CalibratedCamera(camera, conversions.lens_from_message(info))
