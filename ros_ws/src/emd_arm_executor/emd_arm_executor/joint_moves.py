"""Moves of the arms through free space from posture to posture, without contact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.joint_path import JointPath, travel_parameters
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.via_poses import line_poses
from emd_core.errors import CollisionError, OutOfReachError
from emd_core.frames import FloatArray, inverse_transform


@dataclass(frozen=True)
class JointMove:
    """A wish: bring some arms from one posture to another.

    Attributes:
        name: What the move is called in an error.
        arms: The arms, in the order of the positions.
        start: Joint positions, shape (n,), radians.
        goal: Joint positions, shape (n,), radians.
        others: Positions of joints that do not move.
        widths: Opening of each arm's jaws, metres.
    """

    name: str
    arms: tuple[str, ...]
    start: FloatArray
    goal: FloatArray
    others: Mapping[str, float]
    widths: Mapping[str, float]


# Heights above the table through which hands go when the straight way is blocked, metres.
_RAISED = (0.10, 0.16, 0.22)
# A rise that is not worth a motion of its own, metres.
_LEVEL = 2e-3


def plan_joint_move(robot: RobotModel, move: JointMove) -> list[JointPath]:
    """Find a free way, from a short list that is always tried in the same order.

    All arms straight at once; one arm after the other; then the same with the hands raised
    first from the start, above the goal, or both. A planner with random samples would find more,
    but not the same way twice (paper, IV-B).

    Args:
        robot: The robot.
        move: The wish. What touches at its start may go on touching.

    Returns:
        Paths from rest to rest, one after the other; none if there is nothing to move.

    Raises:
        CollisionError: If every way touches something; says what was met first.
    """
    if np.abs(move.goal - move.start).max() < 1e-6:
        return []
    first: CollisionError | None = None
    for way in _ways(robot, move):
        try:
            for path in way:
                check_joint_path(robot, path, move)
        except CollisionError as err:
            first = first or err
        else:
            return way
    raise first or CollisionError(f"no way to move was found for '{move.name}'")


def check_joint_path(robot: RobotModel, path: JointPath, move: JointMove) -> None:
    """Refuse a path on which something touches that does not touch at the move's start.

    Raises:
        CollisionError: Names the links and where on the path they meet.
    """
    names = robot.joint_names(move.arms)
    start = robot.configurations(move.others, names, move.start[None], move.widths)[0]
    _, positions = path.densely(robot.config.collision.path_step)
    rows = robot.configurations(move.others, path.joint_names, positions, move.widths)
    robot.collision.check_path(rows, move.name, robot.collision.contacts(start))


def _ways(robot: RobotModel, move: JointMove) -> Iterator[list[JointPath]]:
    yield from _one_by_one(robot, move, move.start, move.goal)
    for height in _RAISED:
        raised_start = raise_hands(robot, move.arms, move.start, height)
        raised_goal = raise_hands(robot, move.arms, move.goal, height)
        for up, down in ((raised_start, None), (None, raised_goal), (raised_start, raised_goal)):
            if up is None and down is None:
                continue
            begin = up.positions(up.length) if up else move.start
            end = down.positions(down.length) if down else move.goal
            for across in _one_by_one(robot, move, begin, end):
                yield [p for p in (up, *across, down and _reversed(down)) if p]


def _one_by_one(
    robot: RobotModel, move: JointMove, start: FloatArray, goal: FloatArray
) -> Iterator[list[JointPath]]:
    """Yield the straight ways: all arms together, then one after the other in either order."""
    names = robot.joint_names(move.arms)
    yield [JointPath.straight(names, start, goal)]
    if len(move.arms) < 2:
        return
    slices = _slices(robot, move.arms)
    for order in (range(len(move.arms)), reversed(range(len(move.arms)))):
        here, way = start, []
        for index in order:
            there = here.copy()
            there[slices[index]] = goal[slices[index]]
            way.append(JointPath.straight(names, here, there))
            here = there
        yield way


def raise_hands(
    robot: RobotModel, arms: Sequence[str], positions: FloatArray, height: float
) -> JointPath | None:
    """Lift the hands of a posture straight up to a height above the table.

    Returns:
        The path, or None if all hands are (almost) there already or one cannot rise that far.
    """
    to_base = robot.transform_table_to_base
    slices = _slices(robot, arms)
    pairs = list(zip(arms, slices, strict=True))
    start = np.stack([robot.arms[arm].forward(positions[part]) for arm, part in pairs])
    start = inverse_transform(to_base) @ start
    end = start.copy()
    end[:, 2, 3] = np.maximum(end[:, 2, 3], height)
    if np.abs(end - start).max() < _LEVEL:
        return None
    poses = line_poses(start, end, robot.config.path)
    try:
        columns = [
            follow_poses(robot.arms[arm], to_base @ poses[h], positions[part])
            for h, (arm, part) in enumerate(pairs)
        ]
    except OutOfReachError:
        return None
    names = robot.joint_names(arms)
    return JointPath.through(names, np.concatenate(columns, axis=1), travel_parameters(poses))


def _reversed(path: JointPath) -> JointPath:
    parameters = path.spline.x
    return JointPath.through(
        path.joint_names, path.positions(parameters)[::-1], path.length - parameters[::-1]
    )


def _slices(robot: RobotModel, arms: Sequence[str]) -> list[slice]:
    """Give the columns of each arm's joints."""
    counts = [len(robot.joint_names([arm])) for arm in arms]
    ends = np.cumsum(counts).tolist()
    return [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
