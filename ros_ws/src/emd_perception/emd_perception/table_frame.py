"""Where the table frame lies in the camera's view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_perception.config import PlaneConfig
from emd_perception.table_plane import TablePlane


@dataclass(frozen=True)
class RefinedTableFrame:
    """Known extrinsics, corrected by the measured plane of the table.

    Attributes:
        transform_camera_to_table: Shape (4, 4), metres.
        tilt: Angle between the measured plane and the known one, radians.
        offset: Height of the measured plane over the known one at the table frame's origin,
            metres.
        agrees: Whether both differ little enough for the measured plane to be used; if not, the
            transform is the known one, unchanged.
    """

    transform_camera_to_table: FloatArray
    tilt: float
    offset: float
    agrees: bool


def check_transform(transform_camera_to_table: FloatArray) -> None:
    """Check that a matrix is a rigid transform.

    Raises:
        InvalidInputError: If the shape is not (4, 4), a value is not finite, or the matrix is not
            a rotation with a translation.
    """
    transform = np.asarray(transform_camera_to_table)
    if transform.shape != (4, 4) or not np.isfinite(transform).all():
        raise InvalidInputError(
            f"extrinsics must be a finite 4 x 4 matrix, got shape {transform.shape}; see "
            "emd_core.frames.transform_from_pose"
        )
    rotation = transform[:3, :3]
    is_rotation = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-4
    if (
        not is_rotation
        or np.linalg.det(rotation) < 0
        or np.abs(transform[3] - [0, 0, 0, 1]).max() > 1e-8
    ):
        raise InvalidInputError(
            "extrinsics must be a rotation and a translation with the last row 0 0 0 1; "
            "normalise the quaternion that they come from"
        )


def plane_from_transform(transform_camera_to_table: FloatArray) -> FloatArray:
    """Give the table's plane a, b, c, d in the camera optical frame, from known extrinsics."""
    return np.asarray(transform_camera_to_table[2], dtype=np.float64).copy()


def refine_table_frame(
    transform_camera_to_table: FloatArray, plane: TablePlane, config: PlaneConfig | None = None
) -> RefinedTableFrame:
    """Correct tilt and height of known extrinsics so that the measured plane becomes z = 0.

    The correction turns about the table frame's origin by the smallest angle, so x and y of what
    lies there stay as the extrinsics say.

    Args:
        transform_camera_to_table: Known extrinsics, shape (4, 4), metres.
        plane: Measured plane in the camera optical frame.
        config: Largest tilt and offset that count as a correction; the defaults if None.
    """
    settings = config or PlaneConfig()
    rotation = transform_camera_to_table[:3, :3]
    normal_in_table = rotation @ plane.normal
    distance = plane.coefficients[3] - normal_in_table @ transform_camera_to_table[:3, 3]
    tilt = float(np.arctan2(np.linalg.norm(normal_in_table[:2]), normal_in_table[2]))
    # The plane is n . p + distance = 0 in the known table frame; it meets the z axis here:
    offset = float(-distance / normal_in_table[2]) if abs(normal_in_table[2]) > 1e-6 else np.inf
    if tilt > settings.max_tilt or abs(offset) > settings.max_offset:
        return RefinedTableFrame(transform_camera_to_table.copy(), tilt, offset, False)
    correction = np.eye(4)
    axis = np.cross(normal_in_table, [0.0, 0.0, 1.0])
    length = np.linalg.norm(axis)
    if length > 0:
        correction[:3, :3] = Rotation.from_rotvec(axis / length * tilt).as_matrix()
    correction[:3, 3] = correction[:3, :3] @ [0.0, 0.0, -offset]
    return RefinedTableFrame(correction @ transform_camera_to_table, tilt, offset, True)


def table_frame_from_plane(plane: TablePlane, origin_in_camera: FloatArray) -> FloatArray:
    """Build the table frame from the plane alone, where no extrinsics are known.

    z is the plane's normal, x runs down the picture, y to its right (docs/conventions.md).

    Args:
        plane: Measured plane in the camera optical frame.
        origin_in_camera: Shape (3,), metres; its foot on the plane becomes the origin.

    Returns:
        transform_camera_to_table, shape (4, 4), metres.

    Raises:
        InvalidInputError: If the camera looks along the table, so that "down" has no direction
            on it.
    """
    z_axis = plane.normal
    down = np.array([0.0, 1.0, 0.0]) - z_axis[1] * z_axis
    if np.linalg.norm(down) < 1e-3:
        raise InvalidInputError(
            "the camera must look down at the table, got one that looks along it; tilt the camera "
            "or give the extrinsics"
        )
    x_axis = down / np.linalg.norm(down)
    rotation = np.vstack([x_axis, np.cross(z_axis, x_axis), z_axis])
    foot = origin_in_camera - (z_axis @ origin_in_camera + plane.coefficients[3]) * z_axis
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -rotation @ foot
    return transform
