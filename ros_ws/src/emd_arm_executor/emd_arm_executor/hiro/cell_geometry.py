"""Where the table stands before the robot, and where the head camera looks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from emd_arm_executor.hiro.figures.joints import TORSO_AND_HEAD
from emd_arm_executor.hiro.figures.shapes import CAMERA_PITCH_DEGREES, CAMERA_POSITION
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform


@dataclass(frozen=True)
class CellGeometry:
    """The `table` frame, the table and the floor, seen from the robot's base frame WAIST.

    The paper gives no measures of its cell. The table frame is placed so that a vertical hand with
    nails reaches all corners of a 0.40 m cloth, each arm on its own side, on the table and 0.10 m
    above it. That leaves little to choose: a centimetre nearer, higher or lower, and either the
    far corners on the table or the near corners in the air are lost. Table and floor have the
    sizes of HIRO's cell at AIST.

    Attributes:
        table_origin_in_waist: Origin of the table frame, metres.
        table_yaw: Angle of the table frame about z against WAIST, radians.
        table_near_edge: x of the table top's edge nearest to the robot, WAIST frame, metres.
        table_size: Depth, width and thickness of the table top, metres.
        floor_height: z of the floor in the WAIST frame, metres.
        workspace_lower: Lowest corner of a box, table frame, metres, in which a vertical hand gets
            to every point, each arm on its own side. At the cloth's corners the arms reach a
            little beyond it, along the near edge between them they do not.
        workspace_upper: Highest corner of that box.
    """

    table_origin_in_waist: tuple[float, float, float] = (0.32, 0.0, -0.04)
    table_yaw: float = math.pi
    table_near_edge: float = 0.0
    table_size: tuple[float, float, float] = (0.70, 1.40, 0.03)
    floor_height: float = -0.80
    workspace_lower: tuple[float, float, float] = (-0.18, -0.25, 0.0)
    workspace_upper: tuple[float, float, float] = (0.16, 0.25, 0.10)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is not finite, a length is not positive, the workspace is
                empty or the table lies below the floor.
        """
        values = np.concatenate(
            [self.table_origin_in_waist, self.table_size, self.workspace_lower]
            + [self.workspace_upper, (self.table_yaw, self.table_near_edge, self.floor_height)]
        )
        if values.shape != (15,) or not np.isfinite(values).all():
            raise InvalidInputError(f"the cell's geometry must be finite vectors (3,), got {self}")
        if min(self.table_size) <= 0:
            raise InvalidInputError(f"table_size must be positive lengths, got {self.table_size}")
        if not np.less(self.workspace_lower, self.workspace_upper).all():
            raise InvalidInputError(
                f"workspace_lower must lie below workspace_upper, got {self.workspace_lower} and "
                f"{self.workspace_upper}"
            )
        if self.table_origin_in_waist[2] - self.table_size[2] <= self.floor_height:
            raise InvalidInputError(
                f"the table top at z = {self.table_origin_in_waist[2]} m must lie above the floor "
                f"at {self.floor_height} m"
            )

    @property
    def transform_table_to_waist(self) -> FloatArray:
        """Map points of the table frame into WAIST, 4 x 4."""
        transform = np.eye(4)
        cosine, sine = math.cos(self.table_yaw), math.sin(self.table_yaw)
        transform[:2, :2] = [[cosine, -sine], [sine, cosine]]
        transform[:3, 3] = self.table_origin_in_waist
        return transform

    @property
    def transform_waist_to_table(self) -> FloatArray:
        """Map points of WAIST into the table frame, 4 x 4."""
        return inverse_transform(self.transform_table_to_waist)

    @property
    def table_centre_in_waist(self) -> FloatArray:
        """Middle of the table top's box in WAIST, shape (3,), metres."""
        depth, _, thickness = self.table_size
        x = self.table_near_edge + depth / 2
        _, y, z = self.table_origin_in_waist
        return np.array([x, y, z - thickness / 2])


def transform_camera_to_waist(head_pan: float, head_tilt: float) -> FloatArray:
    """Map points of the camera's optical frame into WAIST, 4 x 4, with the chest at zero.

    Args:
        head_pan: HEAD_JOINT0, radians, positive to the left.
        head_tilt: HEAD_JOINT1, radians, positive down.
    """
    neck = np.array(TORSO_AND_HEAD[1].origin)
    head = Rotation.from_euler("ZY", [head_pan, head_tilt])
    mount = Rotation.from_euler("y", CAMERA_PITCH_DEGREES, degrees=True)
    optical = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    transform = np.eye(4)
    transform[:3, :3] = (head * mount * optical).as_matrix()
    transform[:3, 3] = neck + head.apply(CAMERA_POSITION)
    return transform


def transform_camera_to_table(
    head_pan: float, head_tilt: float, geometry: CellGeometry | None = None
) -> FloatArray:
    """Map points of the camera's optical frame into the table frame, 4 x 4.

    Args:
        head_pan: HEAD_JOINT0, radians, positive to the left.
        head_tilt: HEAD_JOINT1, radians, positive down.
        geometry: Where the table is; the default cell if None.
    """
    geometry = geometry or CellGeometry()
    return geometry.transform_waist_to_table @ transform_camera_to_waist(head_pan, head_tilt)
