"""From a manipulation to a checked, timed motion of the arms (paper, IV-B and V-B).

Everything is computed and checked before anything moves: reach, limits and collisions of the
whole motion. What cannot be done is refused with the reason for every candidate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.hem_contour import extract_hems
from emd_arm_executor.joint_moves import (
    JointMove,
    check_joint_path,
    plan_joint_move,
    raise_hands,
)
from emd_arm_executor.joint_path import JointPath
from emd_arm_executor.manipulation_planner import (
    AT_REST,
    ManipulationPlanner,
    jaws,
    time_joint_path,
)
from emd_arm_executor.motion_plan import MotionPlan, Phase, PhaseName
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_arm_executor.trajectory import TimedPath
from emd_core.errors import CellError, CollisionError, OutOfReachError
from emd_core.frames import FloatArray
from emd_core.independent_manipulation import HandsManipulation


class MotionPlanner:
    """Plans manipulations and the way home for one robot; turns its torso where that helps."""

    def __init__(self, robot: RobotModel, config: MotionConfig | None = None) -> None:
        """Keep the robot and the configuration, the robot's own if None."""
        self.robot = robot
        self.config = config or robot.config

    def plan_motion(
        self,
        manipulation: HandsManipulation,
        silhouette: Silhouette,
        joint_positions: Mapping[str, float],
        avoid_in_table: Sequence[FloatArray] = (),
    ) -> MotionPlan:
        """Plan approach, grasp, carrying, release, retreat and the way home.

        Each used grasp point gets an arm and a hem: the nearest hem, else the second nearest and
        so on; two hands do not cross. An arm that is not used rests. If nothing can be done with
        the torso at rest, it turns first, as little as possible, and back at the end.

        Args:
            manipulation: Grasp points and displacements in the table frame.
            silhouette: The cloth.
            joint_positions: Where the robot's joints are, radians.
            avoid_in_table: Places at hems where a grasp has failed, each (2,), metres.

        Raises:
            NoHemError: If no hem lies near a grasp point.
            OutOfReachError: If no candidate is within reach.
            CollisionError: If every candidate within reach touches something.
            InvalidInputError: If a displacement is too short or a joint is missing.
        """
        contours = extract_hems(silhouette, self.config.hem)
        refused: list[CellError] = []
        for position in self._torso_positions():
            robot = self.robot.at_torso(position)
            posture = self._with_torso(joint_positions, position)
            try:
                turn = self._turn(joint_positions, position)
                plan = ManipulationPlanner(robot, self.config).plan(
                    manipulation, silhouette, contours, posture, avoid_in_table
                )
                return self._turned(plan, turn, posture, refused)
            except (OutOfReachError, CollisionError) as err:
                refused.append(err)
        raise refused[0]

    def plan_home(
        self, joint_positions: Mapping[str, float], open_hands: bool = False
    ) -> MotionPlan:
        """Plan the way to rest from anywhere: hands straight up first if they are low.

        Args:
            joint_positions: Where the robot's joints are, radians.
            open_hands: Whether the jaws open first, dropping what they hold.

        Raises:
            CollisionError: If every way touches something.
        """
        robot = self.robot.at_torso(self._torso_now(joint_positions))
        arms = tuple(robot.arms)
        phases = []
        if open_hands:
            opened = jaws(arms, self.config.grasp.open_width)
            phases.append(Phase(PhaseName.RELEASE, (), opened, self.config.grasp.open_time))
        start = robot.arm_positions(arms, joint_positions)
        goal = robot.rest_positions(arms)
        lift = self._lift(robot, JointMove("home", arms, start, goal, joint_positions, {}))
        if lift is not None:
            start = lift.positions(lift.length)
            risen = time_joint_path(robot, lift, self.config.timing.retreat_speed)
            phases.append(Phase(PhaseName.RETREAT, (risen,)))
        move = JointMove("home", arms, start, goal, joint_positions, {})
        way = plan_joint_move(robot, move)
        at_rest = {**joint_positions, **dict(zip(robot.joint_names(arms), goal, strict=True))}
        segments = [time_joint_path(robot, path) for path in way]
        segments += self._turn(at_rest, self.robot.torso_position)
        phases.append(Phase(PhaseName.HOME, tuple(segments)))
        return MotionPlan(tuple(phases))

    def _torso_positions(self) -> Iterator[float]:
        """Yield where the torso may stand, at rest first."""
        yield self.robot.torso_position
        if self.robot.description.torso is not None:
            yield from (self.robot.torso_position + turn for turn in self.config.grasp.torso_turns)

    def _torso_now(self, joint_positions: Mapping[str, float]) -> float:
        """Give the torso's measured position; that of rest if it is as good as there."""
        torso, rest = self.robot.description.torso, self.robot.torso_position
        now = rest if torso is None else joint_positions.get(torso.joint_name, rest)
        return rest if abs(now - rest) < AT_REST else float(now)

    def _with_torso(
        self, joint_positions: Mapping[str, float], position: float
    ) -> dict[str, float]:
        torso = self.robot.description.torso
        return {**joint_positions, **({torso.joint_name: position} if torso else {})}

    def _turn(self, joint_positions: Mapping[str, float], position: float) -> list[TimedPath]:
        """Turn the torso from where it is to a position, the arms as they are.

        Raises:
            CollisionError: If something touches on the way.
        """
        torso, now = self.robot.description.torso, self._torso_now(joint_positions)
        if torso is None or abs(now - position) < AT_REST:
            return []
        path = JointPath.straight((torso.joint_name,), np.array([now]), np.array([position]))
        nothing = np.zeros(0)
        move = JointMove("turn", (), nothing, nothing, joint_positions, {})
        check_joint_path(self.robot, path, move)
        return [time_joint_path(self.robot, path)]

    def _turned(
        self,
        plan: MotionPlan,
        turn: list[TimedPath],
        posture: Mapping[str, float],
        refused: list[CellError],
    ) -> MotionPlan:
        """Put the torso's turn before a plan and its way back behind it."""
        arms = tuple(self.robot.arms)
        rest = zip(self.robot.joint_names(arms), self.robot.rest_positions(arms), strict=True)
        back = self._turn({**posture, **dict(rest)}, self.robot.torso_position)
        if not turn and not back:
            return plan
        first, *between, last = plan.phases
        phases = (
            replace(first, segments=(*turn, *first.segments)),
            *between,
            replace(last, segments=(*last.segments, *back)),
        )
        reasons = (*(str(reason) for reason in refused), *plan.rejected)
        return replace(plan, phases=phases, rejected=reasons)

    def _lift(self, robot: RobotModel, move: JointMove) -> JointPath | None:
        """Raise the hands that are low, if that is within reach and free."""
        height = self.config.path.retreat_height
        lift = raise_hands(robot, move.arms, move.start, height)
        if lift is None:
            return None
        try:
            check_joint_path(robot, lift, move)
        except CollisionError:
            return None
        return lift
