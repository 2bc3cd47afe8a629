"""Which joints make up an arm, and the robot's model reduced to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class ArmGroup:
    """The joints of one arm and the frame that its hand works with.

    Attributes:
        name: Name of the arm, for example "left".
        joint_names: The arm's joints from the shoulder to the wrist.
        tool_frame: Frame between the fingertips; z out of the fingers, x along the jaws' opening.
        position_limits: Narrower limits than the URDF's of some of the joints, radians.
    """

    name: str
    joint_names: tuple[str, ...]
    tool_frame: str
    position_limits: Mapping[str, tuple[float, float]] = field(default_factory=dict, hash=False)


def reduced_model(model: pin.Model, group: ArmGroup, locked_positions: FloatArray) -> pin.Model:
    """Lock every joint that is not the arm's, and narrow the limits as the group says.

    Args:
        model: The whole robot.
        group: The arm.
        locked_positions: Configuration of the whole robot, shape (nq,), radians.

    Raises:
        InvalidInputError: If a joint or the tool frame is not in the model, the joints are not in
            the order of the chain, or limits do not fit.
    """
    _check_group(model, group)
    locked = [i for i in range(1, model.njoints) if str(model.names[i]) not in group.joint_names]
    reduced = pin.buildReducedModel(model, locked, locked_positions)
    names = tuple(str(name) for name in reduced.names[1:])
    if names != group.joint_names:
        raise InvalidInputError(
            f"the joints of arm {group.name} must be listed from the shoulder to the wrist, got "
            f"{group.joint_names}, the model has {names}"
        )
    _narrow_limits(reduced, group)
    return reduced


def _narrow_limits(model: pin.Model, group: ArmGroup) -> None:
    """Lay the group's own limits over the URDF's.

    Raises:
        InvalidInputError: If one names another joint or leaves nothing of the URDF's range.
    """
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    for name, (low, high) in group.position_limits.items():
        if name not in group.joint_names:
            raise InvalidInputError(
                f"limits of joints of arm {group.name} are wanted, {group.joint_names}, got {name}"
            )
        k = group.joint_names.index(name)
        if not max(low, lower[k]) < min(high, upper[k]):
            raise InvalidInputError(
                f"limits of {name} within {lower[k]:.4f} .. {upper[k]:.4f} rad are wanted, got "
                f"{low:.4f} .. {high:.4f}"
            )
        lower[k], upper[k] = max(low, lower[k]), min(high, upper[k])
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper


def _check_group(model: pin.Model, group: ArmGroup) -> None:
    missing = [name for name in group.joint_names if not model.existJointName(name)]
    if missing or not model.existFrame(group.tool_frame):
        raise InvalidInputError(
            f"arm {group.name} wants joints {group.joint_names} and frame {group.tool_frame}; "
            f"the URDF lacks {missing or [group.tool_frame]}; correct the group or the URDF"
        )


def configuration(model: pin.Model, positions: Mapping[str, float]) -> FloatArray:
    """Arrange named joint positions as the model's configuration, shape (nq,); others are 0.

    Raises:
        InvalidInputError: If a joint is not in the model.
    """
    q = np.array(pin.neutral(model))
    for name, position in positions.items():
        if not model.existJointName(name):
            raise InvalidInputError(f"the URDF has no joint {name}; it has {list(model.names)}")
        q[model.joints[model.getJointId(name)].idx_q] = position
    return q
