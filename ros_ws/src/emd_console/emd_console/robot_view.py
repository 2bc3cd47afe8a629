"""The robot as shapes with poses, from its description and its joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform

_CAMERA_FRAME = "camera_optical_frame"
_LARGEST = 2_000_000  # characters of a description


@dataclass(frozen=True)
class Shape:
    """A visual of the robot.

    Attributes:
        kind: box, cylinder or sphere.
        size: Edge lengths of a box; radius and length of a cylinder along z; radius; metres.
        colour: `#rrggbb`.
    """

    kind: str
    size: tuple[float, ...]
    colour: str


class RobotView:
    """Knows where the robot's visuals are for any posture. Meshes are left out."""

    def __init__(self, description: str) -> None:
        """Read a robot's URDF.

        Raises:
            InvalidInputError: If it cannot be read.
        """
        if len(description) > _LARGEST:
            raise InvalidInputError(
                f"a robot_description of at most {_LARGEST} characters is wanted, got "
                f"{len(description)}"
            )
        try:
            self._model = pin.buildModelFromXML(description)
            geometry = pin.buildGeomFromUrdfString(
                self._model, description, pin.GeometryType.VISUAL
            )
        except (ValueError, RuntimeError) as err:
            raise InvalidInputError(f"robot_description should be a URDF: {err}") from err
        self._data = self._model.createData()
        self._geometry = pin.GeometryModel()
        self.shapes: list[Shape] = []
        for item in geometry.geometryObjects:
            shape = _shape(item)
            if shape is not None:
                self.shapes.append(shape)
                self._geometry.addGeometryObject(item)
        self._placements = self._geometry.createData()
        self._columns = {
            str(name): self._model.joints[self._model.getJointId(str(name))].idx_q
            for name in self._model.names[1:]
        }

    def poses(self, positions: Mapping[str, float]) -> NDArray[np.float32]:
        """Place every shape in the base frame.

        Args:
            positions: Of the joints by name, radians; joints not named stay at zero.

        Returns:
            Position and quaternion x y z w of each shape, shape (N, 7), metres.
        """
        self._pose(positions)
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._placements)
        rows = [pin.SE3ToXYZQUAT(placement) for placement in self._placements.oMg]
        return np.array(rows, dtype=np.float32).reshape(-1, 7)

    def transform_to_base(self, frame: str, positions: Mapping[str, float]) -> FloatArray | None:
        """Pose of a link in the base frame, shape (4, 4); None if there is no such link."""
        if not self._model.existFrame(frame):
            return None
        self._pose(positions)
        pin.updateFramePlacements(self._model, self._data)
        return np.array(self._data.oMf[self._model.getFrameId(frame)].homogeneous)

    def transform_table_to_base(
        self, positions: Mapping[str, float], transform_camera_to_table: FloatArray
    ) -> FloatArray | None:
        """Pose of the table in the base frame, shape (4, 4), through the camera that both know.

        Args:
            positions: Of the joints by name, radians.
            transform_camera_to_table: Of the camera's optical frame, shape (4, 4).

        Returns:
            None if the robot has no such camera.
        """
        camera_to_base = self.transform_to_base(_CAMERA_FRAME, positions)
        if camera_to_base is None:
            return None
        return camera_to_base @ inverse_transform(transform_camera_to_table)

    def _pose(self, positions: Mapping[str, float]) -> None:
        configuration = pin.neutral(self._model)
        for name, value in positions.items():
            if name in self._columns and np.isfinite(value):
                configuration[self._columns[name]] = value
        pin.forwardKinematics(self._model, self._data, configuration)


def _shape(item: pin.GeometryObject) -> Shape | None:
    geometry = item.geometry
    colour = "#" + "".join(f"{round(255 * float(value)):02x}" for value in item.meshColor[:3])
    kind = type(geometry).__name__
    if kind == "Box":
        return Shape("box", tuple((2 * geometry.halfSide).tolist()), colour)
    if kind == "Cylinder":
        return Shape("cylinder", (geometry.radius, 2 * geometry.halfLength), colour)
    if kind == "Sphere":
        return Shape("sphere", (geometry.radius,), colour)
    return None
