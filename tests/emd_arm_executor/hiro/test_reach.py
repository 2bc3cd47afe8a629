"""The table stands where HIRO's arms reach a 0.40 m cloth."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_arm_executor.hiro.description import (
    INITIAL,
    JOINT_GROUPS,
    JOINT_LIMITS,
    OBSERVE,
    URDF_PATH,
)
from emd_core.frames import FloatArray

pinocchio = pytest.importorskip("pinocchio")

# The tool frame's origin while it grips, and while it carries.
GRIP_HEIGHT, CARRY_HEIGHT = 0.004, 0.10


class LeftArm:
    """Forward kinematics of the left arm alone; the right one mirrors it."""

    def __init__(self) -> None:
        """Lock all other joints at zero."""
        model = pinocchio.buildModelFromUrdf(str(URDF_PATH))
        names = JOINT_GROUPS["left_arm"].joints
        locked = [i for i in range(1, model.njoints) if model.names[i] not in names]
        self.model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
        self.data = self.model.createData()
        self.tool = self.model.getFrameId("left_tool")
        self.lower = np.array([JOINT_LIMITS[name].lower for name in names])
        self.upper = np.array([JOINT_LIMITS[name].upper for name in names])

    def reaches(self, position: FloatArray, yaws: FloatArray) -> bool:
        """Whether a vertical hand reaches a point (WAIST, metres) with one of the yaws."""
        rng = np.random.default_rng(0)
        random = [rng.uniform(self.lower, self.upper) for _ in range(3)]
        seeds = [INITIAL.positions("left_arm"), OBSERVE.positions("left_arm"), *random]
        for yaw, seed in itertools.product(yaws, seeds):
            down = Rotation.from_euler("z", yaw) * Rotation.from_euler("x", np.pi)
            goal = pinocchio.SE3(down.as_matrix(), position)
            found = least_squares(
                self._error, seed, bounds=(self.lower, self.upper), args=(goal,), max_nfev=80
            )
            if np.abs(found.fun).max() < 1e-3:
                return True
        return False

    def _error(self, angles: FloatArray, goal) -> FloatArray:
        pinocchio.framesForwardKinematics(self.model, self.data, angles)
        return np.array(pinocchio.log6(self.data.oMf[self.tool].actInv(goal)).vector)


@pytest.mark.parametrize("x", [-0.2, 0.2])
@pytest.mark.parametrize("height", [GRIP_HEIGHT, CARRY_HEIGHT])
def test_corners_of_the_cloth_are_within_reach(x: float, height: float) -> None:
    """A vertical hand reaches both corners of its side, on the table and 0.10 m above it."""
    corner = CellGeometry().transform_table_to_waist @ (x, -0.2, height, 1.0)
    assert LeftArm().reaches(corner[:3], np.radians([0.0, 90.0, -90.0]))


def test_workspace_is_within_reach() -> None:
    """A vertical left hand gets to the corners and the middle of its half of the workspace."""
    geometry, arm = CellGeometry(), LeftArm()
    (x0, y0, _), (x1, _, z1) = geometry.workspace_lower, geometry.workspace_upper
    yaws = np.radians([0.0, 90.0, -90.0, 35.0, -35.0])
    for x, y, z in itertools.product((x0, x1), (y0, y0 / 2, 0.0), (GRIP_HEIGHT, z1)):
        point = geometry.transform_table_to_waist @ (x, y, z, 1.0)
        assert arm.reaches(point[:3], yaws), (x, y, z)


def test_reach_ends_soon_beyond_the_cloth() -> None:
    """The reach test can fail: 6 cm beyond the far corner no vertical hand gets to the table."""
    corner = CellGeometry().transform_table_to_waist @ (-0.26, -0.2, GRIP_HEIGHT, 1.0)
    assert not LeftArm().reaches(corner[:3], np.radians([0.0, 90.0, -90.0]))
