"""The pinhole camera that perception sees with and the simulator renders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics of a camera without distortion; pixel centres lie at whole numbers.

    The defaults are those of a Kinect's registered depth image.

    Attributes:
        width: Columns of the image.
        height: Rows of the image.
        fx: Focal length along a row, pixels.
        fy: Focal length along a column, pixels.
        cx: Column of the principal point, pixels.
        cy: Row of the principal point, pixels.
    """

    width: int = 640
    height: int = 480
    fx: float = 525.0
    fy: float = 525.0
    cx: float = 319.5
    cy: float = 239.5

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If the size or a focal length is not positive and finite.
        """
        values = (self.fx, self.fy, self.cx, self.cy)
        if self.width < 1 or self.height < 1 or not np.isfinite(values).all():
            raise InvalidInputError(f"a camera needs a size and finite intrinsics, got {self}")
        if self.fx <= 0 or self.fy <= 0:
            raise InvalidInputError(f"focal lengths must be positive, got {self.fx}, {self.fy}")

    def project(self, points_in_camera: FloatArray) -> FloatArray:
        """Project points (..., 3) of the optical frame to pixels (..., 2): column, row."""
        x, y, z = np.moveaxis(points_in_camera, -1, 0)
        return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy], axis=-1)

    def unproject(self, depth: FloatArray) -> FloatArray:
        """Give every pixel's point in the optical frame.

        Args:
            depth: Distance along the optical axis, shape (H, W), metres; NaN where unknown.

        Returns:
            Points, shape (H, W, 3), metres; NaN where the depth is.
        """
        if depth.shape != (self.height, self.width):
            raise InvalidInputError(
                f"a depth image of {self.width} x {self.height} is needed for these intrinsics, "
                f"got {depth.shape[1]} x {depth.shape[0]}"
            )
        rows, columns = np.mgrid[: self.height, : self.width]
        x = (columns - self.cx) / self.fx * depth
        y = (rows - self.cy) / self.fy * depth
        return np.stack([x, y, depth], axis=-1)
