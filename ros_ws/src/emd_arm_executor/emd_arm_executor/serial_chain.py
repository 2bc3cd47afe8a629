"""A chain of revolute joints out of a robot's model, for the compiled kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from emd_arm_executor import chain_kernels
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class SerialChain:
    """Fixed parts, axes and limits of n revolute joints from the base to the tool.

    Attributes:
        links: As `chain_kernels` says, shape (n + 1, 3, 5).
        limits: Lower and upper positions, shape (2, n), radians.
    """

    links: FloatArray
    limits: FloatArray

    @classmethod
    def from_model(cls, model: pin.Model, tool_frame: str) -> SerialChain:
        """Read a model whose joints form one chain, for example an arm's reduced model.

        Args:
            model: Only the arm's joints, all others locked.
            tool_frame: Frame behind the last joint.

        Raises:
            InvalidInputError: If a joint is not revolute with limits, or not in the chain.
        """
        data, count = model.createData(), model.njoints - 1
        pin.forwardKinematics(model, data, pin.neutral(model))
        links = np.zeros((count + 1, 3, 5))
        for k in range(count):
            joint = model.joints[k + 1]
            subspace = np.asarray(data.joints[k + 1].S).reshape(6, -1)[:, :1]
            revolute = joint.nq == 1 and np.abs(subspace[:3]).max() < 1e-12
            if not revolute or model.parents[k + 1] != k:
                raise InvalidInputError(
                    f"an arm of revolute joints with limits, one behind the other, is wanted; "
                    f"{model.names[k + 1]} is {joint.shortname()}"
                )
            _fill(links[k], model.jointPlacements[k + 1], subspace[3:, 0])
        tool = model.frames[model.getFrameId(tool_frame)]
        if tool.parentJoint != count:
            raise InvalidInputError(
                f"{tool_frame} should move with the last joint, {model.names[count]}, it moves "
                f"with {model.names[tool.parentJoint]}"
            )
        _fill(links[count], tool.placement, np.zeros(3))
        limits = np.stack([model.lowerPositionLimit, model.upperPositionLimit])
        return cls(links, np.ascontiguousarray(limits))

    def forward(self, positions: FloatArray) -> FloatArray:
        """Give the tool's poses in the base frame, (N, 4, 4), for joint positions (N, n)."""
        rows = np.ascontiguousarray(positions, dtype=np.float64)
        return np.asarray(chain_kernels.tool_poses(self.links, rows))

    def points(self, positions: FloatArray) -> FloatArray:
        """Give origins of joints and tool, base frame, (N, n + 1, 3), for positions (N, n)."""
        rows = np.ascontiguousarray(positions, dtype=np.float64)
        return np.asarray(chain_kernels.joint_points(self.links, rows))

    def jacobian(self, positions: FloatArray) -> FloatArray:
        """Give the geometric Jacobian of the tool, base frame, (6, n), for positions (n,)."""
        row = np.ascontiguousarray(positions, dtype=np.float64)
        return np.asarray(chain_kernels.jacobian_of_tool(self.links, row))


def _fill(link: FloatArray, placement: pin.SE3, axis: FloatArray) -> None:
    link[:, :3], link[:, 3], link[:, 4] = placement.rotation, placement.translation, axis
