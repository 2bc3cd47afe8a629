"""Reads the YAML file that describes a robot: groups of joints, hands, limits and named poses.

Angles are degrees in the file and radians here; an example with every key is `hiro/hiro.yaml`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from emd_core.errors import InvalidInputError

_KEYS = {"name", "urdf", "groups", "arms", "gripper_law", "rest", "poses"}
_OPTIONAL = {"torso", "position_limits", "pair_margins", "table"}
_ARM_KEYS = {"group", "tool_frame", "gripper", "fingertips"}


@dataclass(frozen=True)
class ArmEntry:
    """One arm of the file.

    Attributes:
        group: Group that moves the arm.
        tool_frame: Frame between the fingertips; z out of the fingers, x along the jaws' opening.
        gripper: Group that moves the hand.
        fingertips: Links that may touch the table.
    """

    group: str
    tool_frame: str
    gripper: str
    fingertips: tuple[str, ...]


@dataclass(frozen=True)
class RobotFile:
    """What the file says.

    Attributes:
        name: Of the robot.
        urdf: Path of the model.
        groups: Joints of each controller's group, from the root outwards.
        arms: The arms by name.
        torso: Group that turns all arms, or None.
        gripper_law: Kind and figures of the hands' opening law, as `gripper_law` wants them.
        position_limits: Narrower limits than the URDF's, radians.
        pair_margins: Distances that pairs of links keep instead of the common margin, metres.
        rest: Name of the pose in which the arms wait beside the table.
        poses: Named poses: radians of each group's joints.
        table: Where the table stands, figures of `CellGeometry`; empty for the default cell.
    """

    name: str
    urdf: Path
    groups: Mapping[str, tuple[str, ...]]
    arms: Mapping[str, ArmEntry]
    torso: str | None
    gripper_law: Mapping[str, Any]
    position_limits: Mapping[str, tuple[float, float]]
    pair_margins: Mapping[frozenset[str], float]
    rest: str
    poses: Mapping[str, Mapping[str, tuple[float, ...]]]
    table: Mapping[str, Any]

    @property
    def rest_by_joint(self) -> dict[str, float]:
        """Positions of all joints at rest, radians."""
        pose = self.poses[self.rest]
        return {
            joint: angle
            for group, joints in self.groups.items()
            for joint, angle in zip(joints, pose[group], strict=True)
        }


def read_robot_file(path: Path) -> RobotFile:
    """Read and check a robot's description.

    Args:
        path: YAML file; the URDF's path in it is relative to it.

    Raises:
        InvalidInputError: If the file cannot be read, a key is missing or unknown, or a name does
            not fit; says which and what is wanted.
    """
    content = _load(path)
    _check_keys(content, _KEYS, _OPTIONAL, str(path))
    groups = {name: tuple(joints) for name, joints in content["groups"].items()}
    arms = {name: _arm(path, name, entry) for name, entry in content["arms"].items()}
    # Hands are told openings, so poses leave their joints at 0.
    posable = {g: j for g, j in groups.items() if g not in {arm.gripper for arm in arms.values()}}
    still = {group: (0.0,) * len(joints) for group, joints in groups.items()}
    poses = {
        name: {**still, **_pose(f"{path}: pose {name}", pose or {}, posable)}
        for name, pose in content["poses"].items()
    }
    limits = content.get("position_limits", {})
    file = RobotFile(
        name=str(content["name"]),
        urdf=path.parent / content["urdf"],
        groups=groups,
        arms=arms,
        torso=content.get("torso"),
        gripper_law=content["gripper_law"],
        position_limits={
            joint: (math.radians(low), math.radians(high)) for joint, (low, high) in limits.items()
        },
        pair_margins={
            frozenset({first, second}): float(margin)
            for first, second, margin in content.get("pair_margins", [])
        },
        rest=content["rest"],
        poses=poses,
        table=content.get("table", {}),
    )
    _check_names(path, file)
    return file


def _load(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, yaml.YAMLError) as err:
        raise InvalidInputError(f"{path} should be a robot's description in YAML: {err}") from err
    if not isinstance(content, dict):
        raise InvalidInputError(
            f"{path} should hold keys and values, got {type(content).__name__}"
        )
    return content


def _check_keys(
    content: Mapping[str, Any], wanted: set[str], optional: set[str], where: str
) -> None:
    missing, unknown = wanted - set(content), set(content) - wanted - optional
    if missing or unknown:
        raise InvalidInputError(
            f"{where} needs the keys {sorted(wanted)} and may have {sorted(optional)}; missing: "
            f"{sorted(missing)}, unknown: {sorted(unknown)}"
        )


def _arm(path: Path, name: str, entry: Mapping[str, Any]) -> ArmEntry:
    _check_keys(entry, _ARM_KEYS, set(), f"{path}: arm {name}")
    return ArmEntry(
        entry["group"], entry["tool_frame"], entry["gripper"], tuple(entry["fingertips"])
    )


def _pose(
    where: str, pose: Mapping[str, Sequence[float]], groups: Mapping[str, tuple[str, ...]]
) -> dict[str, tuple[float, ...]]:
    for group, angles in pose.items():
        if group not in groups or len(angles) != len(groups[group]):
            raise InvalidInputError(
                f"{where} should give an angle for each joint of groups of {sorted(groups)}, got "
                f"{group}: {angles}"
            )
    return {group: tuple(math.radians(angle) for angle in pose[group]) for group in pose}


def _check_names(path: Path, file: RobotFile) -> None:
    named = [name for arm in file.arms.values() for name in (arm.group, arm.gripper)]
    named += [file.torso] if file.torso else []
    unknown = sorted(set(named) - set(file.groups))
    if unknown:
        raise InvalidInputError(f"{path} names groups {unknown}; there are {sorted(file.groups)}")
    if file.rest not in file.poses:
        raise InvalidInputError(f"{path}: rest should be one of {sorted(file.poses)}")
    if not 1 <= len(file.arms) <= 2:
        raise InvalidInputError(f"{path} should have one or two arms, got {sorted(file.arms)}")
