"""Moves of the arms through free space from posture to posture, without contact."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.collision import Meeting
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


# Where hands go through when the straight way is blocked: heights above the table, metres, and
# shares of the way to the middle of the table's depth, where the arms are freest.
_RAISED = (0.06, 0.12, 0.20)
_INWARD = (0.0, 0.5, 1.0)
# A rise that is not worth a motion of its own, metres.
_LEVEL = 2e-3


def plan_joint_move(robot: RobotModel, move: JointMove) -> list[JointPath]:
    """Find a free way, from a short list that is always tried in the same order.

    All arms straight at once; one arm after the other if they would meet; then the same with the
    hands first raised from the start, above the goal, or both, straight up or towards the middle.
    A planner with random samples would find more, but not the same way twice (paper, IV-B).

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
    search = _Search(robot, move)
    way = search.across(move.start, move.goal)
    for height, inward in itertools.product(_RAISED, _INWARD):
        if way is not None:
            break
        way = search.raised(height, inward)
    if way is None:
        raise search.refusal()
    return way


def check_joint_path(robot: RobotModel, path: JointPath, move: JointMove) -> None:
    """Refuse a path on which something touches that does not touch at the move's start.

    Raises:
        CollisionError: Names the links and where on the path they meet.
    """
    search = _Search(robot, move)
    if not search.is_free(path):
        raise search.refusal()


class _Search:
    """Looks for free ways of one move and remembers what was met first."""

    def __init__(self, robot: RobotModel, move: JointMove) -> None:
        self._robot, self._move = robot, move
        names = robot.joint_names(move.arms)
        start = robot.configurations(move.others, names, move.start[None], move.widths)[0]
        self._ignored = robot.collision.contacts(start)
        self._first: Meeting | None = None
        self._last: Meeting | None = None

    def is_free(self, path: JointPath) -> bool:
        """Tell whether nothing new touches on a path."""
        move, checker = self._move, self._robot.collision
        _, positions = path.densely(checker.path_step)
        rows = self._robot.configurations(move.others, path.joint_names, positions, move.widths)
        self._last = checker.meeting(rows, self._ignored)
        self._first = self._first or self._last
        return self._last is None

    def refusal(self) -> CollisionError:
        """Say what was met first."""
        if self._first is None:
            return CollisionError(f"no way was found for the motion '{self._move.name}'")
        return self._robot.collision.refusal(self._move.name, self._first)

    def across(self, start: FloatArray, goal: FloatArray) -> list[JointPath] | None:
        """Go straight, all arms at once or, if two of them meet, one after the other."""
        names = self._robot.joint_names(self._move.arms)
        path = JointPath.straight(names, start, goal)
        if self.is_free(path):
            return [path]
        assert self._last is not None
        if len(self._robot.collision.arms_in(self._last.contact)) < 2:
            return None
        for order in (self._move.arms, self._move.arms[::-1]):
            way = self._in_turn(start, goal, order)
            if all(self.is_free(part) for part in way):
                return way
        return None

    def _in_turn(
        self, start: FloatArray, goal: FloatArray, order: Sequence[str]
    ) -> list[JointPath]:
        names = self._robot.joint_names(self._move.arms)
        parts = dict(zip(self._move.arms, _slices(self._robot, self._move.arms), strict=True))
        here, way = start, []
        for arm in order:
            there = here.copy()
            there[parts[arm]] = goal[parts[arm]]
            way.append(JointPath.straight(names, here, there))
            here = there
        return way

    def raised(self, height: float, inward: float) -> list[JointPath] | None:
        """Go through raised hands at the start, at the goal, or at both."""
        start, goal = self._move.start, self._move.goal
        up, down = self._free_rise(start, height, inward), self._free_rise(goal, height, inward)
        for first, last in ((up, None), (None, down), (up, down)):
            if first is None and last is None:
                continue
            begin = first.positions(first.length) if first else start
            end = last.positions(last.length) if last else goal
            across = self.across(begin, end)
            if across is not None:
                return [p for p in (first, *across, last and _reversed(last)) if p]
        return None

    def _free_rise(self, positions: FloatArray, height: float, inward: float) -> JointPath | None:
        rise = raise_hands(self._robot, self._move.arms, positions, height, inward)
        return rise if rise is not None and self.is_free(rise) else None


def raise_hands(
    robot: RobotModel,
    arms: Sequence[str],
    positions: FloatArray,
    height: float,
    inward: float = 0.0,
) -> JointPath | None:
    """Lift the hands of a posture in straight lines to a height above the table.

    Args:
        robot: The robot.
        arms: The arms.
        positions: Their joints, shape (n,), radians.
        height: Metres; a hand that is higher stays.
        inward: Share of the way to x = 0 of the table frame that a rising hand covers, 0..1.

    Returns:
        The path, or None if all hands are (almost) there already or one cannot rise that far.
    """
    to_base = robot.transform_table_to_base
    slices = _slices(robot, arms)
    pairs = list(zip(arms, slices, strict=True))
    start = np.stack([robot.arms[arm].forward(positions[part]) for arm, part in pairs])
    start = inverse_transform(to_base) @ start
    end = start.copy()
    low = end[:, 2, 3] < height
    end[low, 2, 3] = height
    end[low, 0, 3] *= 1.0 - inward
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
