"""Which arm takes which grasp point, and in which order pairs of grips are tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from emd_arm_executor.grip_search import GripSearch, GripTask
from emd_arm_executor.hand_paths import Grip
from emd_arm_executor.robot_model import RobotModel
from emd_core.frames import FloatArray


def assignments(robot: RobotModel, tasks: Sequence[GripTask]) -> Iterator[list[GripSearch]]:
    """Yield the searches for each assignment of arms to points, the likelier first.

    One point goes to the arm on its side of the robot, else to the other. Of two points the left
    one goes to the left arm, so that the hands do not cross.

    Args:
        robot: The robot; at rest each hand is on its arm's side.
        tasks: What is to be done at each point, one or two.
    """
    to_base = robot.transform_table_to_base
    at_rest = {
        name: arm.forward(robot.rest_positions([name]))[1, 3] for name, arm in robot.arms.items()
    }
    # y of the base frame points to the left (REP 103).
    from_left = sorted(at_rest, key=lambda name: -at_rest[name])
    points = np.stack([task.point_in_table for task in tasks])
    lateral = points @ to_base[1, :2] + to_base[1, 3]
    for arms in _arms_for(lateral, from_left):
        yield [GripSearch(robot, arm, task) for arm, task in zip(arms, tasks, strict=True)]


def grip_sets(searches: Sequence[GripSearch], max_pairs: int) -> Iterator[list[Grip]]:
    """Yield one grip for each search, those with the least sum of ranks first.

    Args:
        searches: One or two.
        max_pairs: Most pairs to yield.
    """
    if len(searches) == 1:
        yield from ([grip] for grip in searches[0].all())
        return
    first, second = searches
    yielded, total = 0, 0
    while yielded < max_pairs:
        ranks = [(rank, total - rank) for rank in range(total + 1)]
        pairs = [(first.grip(i), second.grip(j)) for i, j in ranks]
        if all(left is None or right is None for left, right in pairs):
            return
        for left, right in pairs:
            if left is not None and right is not None and yielded < max_pairs:
                yielded += 1
                yield [left, right]
        total += 1


def _arms_for(lateral: FloatArray, from_left: Sequence[str]) -> list[tuple[str, ...]]:
    """List the arms for points at lateral positions y, metres, the likelier assignment first."""
    if len(lateral) == 1:
        return [(arm,) for arm in (from_left if lateral[0] >= 0.0 else reversed(from_left))]
    order = np.argsort(-lateral, kind="stable")
    arms = [""] * len(lateral)
    for place, index in enumerate(order):
        arms[index] = from_left[place]
    return [tuple(arms)]
