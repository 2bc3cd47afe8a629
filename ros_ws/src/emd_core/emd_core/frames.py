"""The table frame and the normalised field of view of the network.

Table frame: origin on the desk's surface in the middle of the field of view, z up, metres. Seen by
the head camera, x runs down the picture (towards the robot) and y to the right, so that the
normalised point (-1, -1) is the upper left and (1, 1) the lower right corner (paper, III-A).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class FieldOfView:
    """The box that the voxel grid covers: [-1, 1] x [-1, 1] x [0, `height`], times `half_extent`.

    The paper gives the box [-1, -1, 0] to [1, 1, 0.25] in normalised units and a cloth side of
    1.4 (IV-A); its metric size is the laboratory's choice. The default makes a cloth of 0.40 m
    span 1.4.

    Attributes:
        half_extent: Metres of one normalised unit, > 0.
        height: Height of the box in normalised units, > 0.
        size: Voxels along x, y and z.
    """

    half_extent: float = 0.40 / 1.4
    height: float = 0.25
    size: tuple[int, int, int] = (32, 32, 16)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a length is not positive and finite, or a size is below 1.
        """
        for name, value in (("half_extent", self.half_extent), ("height", self.height)):
            if not np.isfinite(value) or value <= 0:
                raise InvalidInputError(
                    f"{name} must be a positive length, got {value}; give it in "
                    f"{'metres' if name == 'half_extent' else 'normalised units'}"
                )
        if len(self.size) != 3 or min(self.size) < 1:
            raise InvalidInputError(f"size must be three counts of at least 1, got {self.size}")

    @property
    def z_scale(self) -> float:
        """Factor on z before rasterisation: 4 in the paper (III-A), which makes voxels cubic."""
        return 1.0 / self.height

    @property
    def resolution(self) -> FloatArray:
        """Edge lengths of one voxel along x, y and z, shape (3,), metres."""
        extent = np.array([2.0, 2.0, self.height]) * self.half_extent
        return extent / np.array(self.size)

    @property
    def origin(self) -> FloatArray:
        """Lowest corner of the grid in the table frame, shape (3,), metres."""
        return np.array([-self.half_extent, -self.half_extent, 0.0])

    def normalised_from_table(self, in_table: ArrayLike) -> FloatArray:
        """Scale points or displacements from the table frame (metres) to normalised units."""
        return np.asarray(in_table, dtype=np.float64) / self.half_extent

    def table_from_normalised(self, normalised: ArrayLike) -> FloatArray:
        """Scale points or displacements from normalised units to the table frame (metres)."""
        return np.asarray(normalised, dtype=np.float64) * self.half_extent


def transform_from_pose(position: ArrayLike, quaternion_xyzw: ArrayLike) -> FloatArray:
    """Build the 4 x 4 matrix that maps points of the child frame into the parent frame.

    Args:
        position: Origin of the child frame in the parent frame, shape (3,), metres.
        quaternion_xyzw: Orientation of the child frame in the parent frame, shape (4,).

    Raises:
        InvalidInputError: If a value is not finite or the quaternion has no length.
    """
    position_array = np.asarray(position, dtype=np.float64)
    quaternion = np.asarray(quaternion_xyzw, dtype=np.float64)
    if position_array.shape != (3,) or quaternion.shape != (4,):
        raise InvalidInputError(
            "a pose needs a position (3,) and a quaternion x y z w (4,), got shapes "
            f"{position_array.shape} and {quaternion.shape}"
        )
    if not np.isfinite(position_array).all() or not np.isfinite(quaternion).all():
        raise InvalidInputError("a pose must be finite, got NaN or infinity")
    if np.linalg.norm(quaternion) < 1e-6:
        raise InvalidInputError("a quaternion must have length 1, got 0; no rotation is 0 0 0 1")
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    transform[:3, 3] = position_array
    return transform


def pose_from_transform(transform: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Split a 4 x 4 transform into position (3,) and quaternion x y z w (4,)."""
    return transform[:3, 3].copy(), Rotation.from_matrix(transform[:3, :3]).as_quat()


def transform_points(transform: FloatArray, points: FloatArray) -> FloatArray:
    """Map points of shape (..., 3) from the child into the parent frame of `transform`."""
    return points @ transform[:3, :3].T + transform[:3, 3]


def inverse_transform(transform: FloatArray) -> FloatArray:
    """Invert a rigid 4 x 4 transform."""
    inverse = np.eye(4)
    inverse[:3, :3] = transform[:3, :3].T
    inverse[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return inverse
