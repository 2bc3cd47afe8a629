"""Whatever a camera gives, as the registered, straight pair of images that perception takes."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, transform_from_pose
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import ColourImage, DepthImage
from emd_perception.lens import ColourRectifier, pixel_directions
from emd_perception.registration import arrange_points, draw_depth


class DepthSource(StrEnum):
    """Where the depth comes from."""

    REGISTERED = "registered"
    UNREGISTERED = "unregistered"
    POINTS = "points"


@dataclass(frozen=True)
class InputConfig:
    """What the camera gives.

    Attributes:
        depth: registered (a depth image of the colour camera's pixels), unregistered (a depth
            image of its own camera) or points (a point cloud).
        rectified: Whether the images are straight already, so that the distortion that their
            calibration tells of is not taken out again.
        depth_position: Position of the depth camera, or of the cloud's frame, in the colour
            camera's optical frame: x y z, metres. For unregistered and points.
        depth_orientation: Its orientation there: quaternion x y z w.
    """

    depth: str = DepthSource.REGISTERED.value
    rectified: bool = False
    depth_position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    depth_orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check source and pose.

        Raises:
            InvalidInputError: If the source is unknown, the pose is not finite or the quaternion
                has no length, or a pose is given for depth that is registered.
        """
        if self.depth not in list(DepthSource):
            raise InvalidInputError(
                f"the depth's source must be one of {', '.join(DepthSource)}, got '{self.depth}'"
            )
        moved = not np.allclose(self.transform_depth_to_colour, np.eye(4))
        if moved and self.source is DepthSource.REGISTERED:
            raise InvalidInputError(
                "depth that is registered has the colour camera's pose, got another one; give "
                "depth: unregistered, or leave depth_position and depth_orientation out"
            )

    @property
    def source(self) -> DepthSource:
        """Where the depth comes from."""
        return DepthSource(self.depth)

    @property
    def transform_depth_to_colour(self) -> FloatArray:
        """Map points of the depth camera's frame into the colour camera's, shape (4, 4)."""
        return transform_from_pose(self.depth_position, self.depth_orientation)


@dataclass(frozen=True)
class CalibratedCamera:
    """Intrinsics and lens of one camera."""

    camera: PinholeCamera
    lens: LensDistortion = field(default_factory=LensDistortion)

    def without_distortion(self) -> CalibratedCamera:
        """The camera that took images which are straight already."""
        return CalibratedCamera(self.camera)


@dataclass(frozen=True)
class Frame:
    """Colour and depth of one moment, straight and registered.

    Attributes:
        colour: Shape (H, W, 3), RGB uint8.
        depth: Shape (H, W), metres, NaN where unknown.
        camera: Of both.
    """

    colour: ColourImage
    depth: DepthImage
    camera: PinholeCamera


class FrameAligner:
    """Straightens colour and registers depth to it; keeps its tables while the cameras stay."""

    def __init__(
        self,
        config: InputConfig,
        colour_camera: CalibratedCamera,
        depth_camera: CalibratedCamera | None = None,
    ) -> None:
        """Prepare for one pair of cameras.

        Args:
            config: What they give.
            colour_camera: Of the colour image.
            depth_camera: Of an unregistered depth image; the colour camera otherwise.

        Raises:
            InvalidInputError: If the depth is unregistered and its camera is missing.
        """
        self._config = config
        if config.source is DepthSource.UNREGISTERED and depth_camera is None:
            raise InvalidInputError(
                "depth that is not registered needs the calibration of its own camera"
            )
        own = config.source is DepthSource.UNREGISTERED
        seen_by = depth_camera if own and depth_camera is not None else colour_camera
        if config.rectified:
            colour_camera, seen_by = (one.without_distortion() for one in (colour_camera, seen_by))
        self.camera = colour_camera.camera
        self._rectifier = ColourRectifier(colour_camera.camera, colour_camera.lens)
        self._depth_camera = seen_by
        self._rays: FloatArray | None = None

    def colour(self, colour: ColourImage) -> ColourImage:
        """Straighten a colour image, shape (H, W, 3).

        Raises:
            InvalidInputError: If it does not have the camera's size.
        """
        _check_size(colour.shape, self.camera, "colour image")
        return self._rectifier.rectify(colour)

    def depth(self, depth: DepthImage) -> DepthImage:
        """Give a depth image for the straightened colour image.

        Args:
            depth: Shape (H, W) of the depth camera, metres, NaN where unknown.

        Returns:
            Shape (H, W) of the colour camera, metres, NaN where unknown.

        Raises:
            InvalidInputError: If it does not have the depth camera's size.
        """
        _check_size(depth.shape, self._depth_camera.camera, "depth image")
        fits = self._config.source is DepthSource.REGISTERED and self._depth_camera.lens.is_none
        if fits:
            return depth
        if self._rays is None:
            directions = pixel_directions(self._depth_camera.camera, self._depth_camera.lens)
            self._rays = np.concatenate([directions, np.ones((*depth.shape, 1))], axis=2)
        points = self._rays * depth[..., None]
        return draw_depth(points, self.camera, self._config.transform_depth_to_colour)

    def depth_of_points(self, points: FloatArray) -> DepthImage:
        """Give the depth image that the colour camera would have of a cloud.

        Args:
            points: Shape (H, W, 3) if neighbours are neighbours in space, else (1, N, 3) or
                (N, 3); metres in the cloud's frame, NaN where unknown.

        Raises:
            InvalidInputError: If the shape is another one.
        """
        transform = self._config.transform_depth_to_colour
        if points.ndim not in (2, 3) or points.shape[-1] != 3:
            raise InvalidInputError(f"points (H, W, 3) or (N, 3) are needed, got {points.shape}")
        if points.ndim == 2 or 1 in points.shape[:2]:
            points = arrange_points(points.reshape(-1, 3), self.camera, transform)
        return draw_depth(points, self.camera, transform)


def _check_size(shape: tuple[int, ...], camera: PinholeCamera, what: str) -> None:
    if shape[:2] != (camera.height, camera.width):
        raise InvalidInputError(
            f"the {what} has {shape[1]} x {shape[0]} pixels, but its calibration is for "
            f"{camera.width} x {camera.height}; publish the camera_info of this camera mode, and "
            "depth of another size as unregistered"
        )
