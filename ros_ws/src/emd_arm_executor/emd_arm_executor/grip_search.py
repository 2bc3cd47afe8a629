"""Which arm can grip which hem, and how: candidates in the order of preference."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.grasp import GraspPose, displacements_keeping_creases, grasp_poses
from emd_arm_executor.hand_paths import (
    Grip,
    carrying_poses,
    descent_poses,
    follow_carrying,
    follow_descent,
)
from emd_arm_executor.hem import Hem
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import CellError, CollisionError, OutOfReachError
from emd_core.frames import FloatArray

# Step along the path while candidates are screened, metres, and what a joint may turn in it.
_COARSE_STEP = 0.03
_COARSE_JOINT_STEP = 0.8

# Poses of one hand on two parts of its way, each (N, 4, 4), table frame.
_Poses = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class GripTask:
    """What one hand is to do with the cloth.

    Attributes:
        point_in_table: The planned grasp point, shape (2,), metres.
        displacement_in_table: As planned, shape (2,), metres.
        hems: The hems of the point, the nearest first.
        silhouette: The cloth.
        config: Postures to try.
    """

    point_in_table: FloatArray
    displacement_in_table: FloatArray
    hems: Sequence[Hem]
    silhouette: Silhouette
    config: MotionConfig


class GripSearch:
    """The grips with which one arm can carry out its part, found one by one as they are asked.

    A grip counts when its arm reaches the whole path, lowering, insertion, carrying, release and
    retreat, and touches nothing, seen in coarse steps and with the other arm at rest. The planner
    then looks at the chosen grips finely and together. The nearest hem comes first, then the
    second nearest and so on (paper, V-B); at each hem the vertical hand orthogonal to it.
    """

    def __init__(self, robot: RobotModel, arm: str, task: GripTask) -> None:
        """Prepare the search; nothing is computed yet.

        Args:
            robot: The robot.
            arm: The arm.
            task: What its hand is to do.
        """
        self.arm = arm
        self.rejected: list[CellError] = []
        self._robot, self._task, self._config = robot, task, task.config
        step = replace(task.config.path, linear_step=_COARSE_STEP, angular_step=_COARSE_JOINT_STEP)
        self._coarse = replace(task.config, path=step)
        self._found: list[Grip] = []
        self._source = self._search()

    def grip(self, index: int) -> Grip | None:
        """Give the grip of a rank, 0 first; None if there are not so many."""
        while len(self._found) <= index:
            found = next(self._source, None)
            if found is None:
                return None
            self._found.append(found)
        return self._found[index]

    def all(self) -> Iterator[Grip]:
        """Yield all grips in the order of their rank."""
        index = 0
        while (grip := self.grip(index)) is not None:
            yield grip
            index += 1

    def _search(self) -> Iterator[Grip]:
        for rank, hem in enumerate(self._task.hems):
            before = len(self._found)
            reasons: list[CellError] = []
            for pair in _pairs(list(grasp_poses(hem, self._config.grasp))):
                yield from self._at_posture(pair, reasons)
            if len(self._found) == before and reasons:
                # A collision was met farther along the way than the end of an arm's reach.
                met = next((r for r in reasons if isinstance(r, CollisionError)), reasons[0])
                self.rejected.append(type(met)(f"hem {rank + 1}, {self.arm} arm: {met}"))

    def _at_posture(self, poses: Sequence[GraspPose], reasons: list[CellError]) -> Iterator[Grip]:
        """Yield the grips of one posture, the half turn and branch of the least cost first."""
        kinematics = self._robot.arms[self.arm]
        rest = self._robot.rest_positions([self.arm])
        restarts = self._config.kinematics.grasp_restarts
        grips: list[tuple[Grip, _Poses]] = []
        for grasp in poses:
            target = self._robot.transform_table_to_base @ grasp.transform_tool_to_table
            solutions = kinematics.solutions(target, (rest,), restarts)
            branches = [Grip(self.arm, grasp, positions) for positions in solutions]
            if branches:
                onward = self._carrying(branches[0])
                grips += [(grip, onward) for grip in branches]
        if not grips:
            target = self._robot.transform_table_to_base @ poses[0].transform_tool_to_table
            if not reasons:
                reasons.append(kinematics.out_of_reach(target, (rest,)))
            return
        grips.sort(key=lambda each: kinematics.posture_cost(each[0].positions, rest))
        usable = [
            grip for grip, onward in grips if _reaches(partial(self._carry, grip, onward), reasons)
        ]
        for distance in self._config.grasp.pre_grasp_distances:
            for grip in usable:
                candidate = replace(grip, pre_grasp_distance=distance)
                if _reaches(partial(self._descend, candidate), reasons):
                    yield candidate
                    return

    def _carrying(self, grip: Grip) -> _Poses:
        """Lay the hand's coarse ways while carrying and retreating, by its grasp alone."""
        displacement = self._task.displacement_in_table[None]
        if self._config.grasp.keep_crease:
            displacement = displacements_keeping_creases(
                displacement,
                self._task.point_in_table[None],
                [grip.grasp],
                self._config.grasp.jaw_depth,
            )
        carried, up = carrying_poses([grip], displacement, self._task.silhouette, self._coarse)
        return carried[0], up[0]

    def _carry(self, grip: Grip, poses: _Poses) -> None:
        ways = follow_carrying(self._robot, grip, poses, _COARSE_JOINT_STEP)
        self._check(ways, self._config.grasp.closed_width, "carry")

    def _descend(self, grip: Grip) -> None:
        lower, insert = descent_poses([grip], self._task.silhouette, self._coarse)
        ways = follow_descent(self._robot, grip, (lower[0], insert[0]), _COARSE_JOINT_STEP)
        self._check(ways, self._config.grasp.open_width, "lower")

    def _check(self, ways: Sequence[FloatArray], width: float, name: str) -> None:
        """Refuse what this arm alone collides with; the other one rests."""
        names = self._robot.joint_names([self.arm])
        rows = self._robot.configurations({}, names, np.concatenate(ways), {self.arm: width})
        self._robot.collision.check_path(rows, name)


def _reaches(follow: Callable[[], None], reasons: list[CellError]) -> bool:
    """Tell whether an arm can go its way; if not, add the reason to `reasons`."""
    try:
        follow()
    except (OutOfReachError, CollisionError) as err:
        reasons.append(err)
        return False
    return True


def _pairs(poses: Sequence[GraspPose]) -> Iterator[Sequence[GraspPose]]:
    """Group postures with their half turns, which `grasp_poses` yields side by side."""
    for index in range(0, len(poses), 2):
        yield poses[index : index + 2]
