"""From the table to the camera's picture and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform, transform_points
from emd_core.pinhole_camera import PinholeCamera


@dataclass(frozen=True)
class TableProjection:
    """A camera that looks at the table.

    Attributes:
        camera: Its intrinsics.
        transform_camera_to_table: Pose of its optical frame in the table frame, shape (4, 4).
    """

    camera: PinholeCamera
    transform_camera_to_table: FloatArray

    def pixels(self, points_in_table: FloatArray) -> FloatArray:
        """Project points (N, 3) in metres to pixels (N, 2): column, row; NaN behind the camera."""
        to_camera = inverse_transform(self.transform_camera_to_table)
        in_camera = transform_points(to_camera, np.asarray(points_in_table, dtype=np.float64))
        in_camera = np.where(in_camera[:, 2:] > 1e-6, in_camera, np.nan)
        return np.asarray(self.camera.project(in_camera))

    def table_points(self, pixels: FloatArray, height: float = 0.0) -> FloatArray:
        """Find where the rays through pixels meet a plane parallel to the table.

        Args:
            pixels: Shape (N, 2): column, row; inside the picture.
            height: Of the plane above the table, metres.

        Returns:
            x and y in the table frame, shape (N, 2), metres.

        Raises:
            InvalidInputError: If a pixel is outside the picture or its ray never meets the plane.
        """
        values = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        size = np.array([self.camera.width, self.camera.height])
        if not np.isfinite(values).all() or (values < -0.5).any() or (values > size - 0.5).any():
            raise InvalidInputError(
                f"a point inside the picture of {size[0]} x {size[1]} pixels is wanted, got "
                f"{values.tolist()}"
            )
        c = self.camera
        rays = np.column_stack([(values - [c.cx, c.cy]) / [c.fx, c.fy], np.ones(len(values))])
        directions = rays @ self.transform_camera_to_table[:3, :3].T
        eye = self.transform_camera_to_table[:3, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (height - eye[2]) / directions[:, 2]
        if not np.isfinite(distance).all() or (distance <= 0).any():
            raise InvalidInputError(
                "a point on the table is wanted, the one given lies above the horizon; choose a "
                "lower one in the picture"
            )
        return np.asarray((eye + distance[:, None] * directions)[:, :2])
