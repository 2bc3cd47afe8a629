"""One manipulation as a checked, timed motion while the torso stands still (paper, IV-B, V-B)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.grasp import displacements_keeping_creases
from emd_arm_executor.grip_assignment import assignments, grip_sets
from emd_arm_executor.grip_search import GripTask
from emd_arm_executor.hand_paths import Grip, HandPaths, hand_paths
from emd_arm_executor.hem import Hem, facing, find_hems
from emd_arm_executor.hem_contour import HemContour
from emd_arm_executor.joint_moves import JointMove, plan_joint_move
from emd_arm_executor.joint_path import JointPath
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import GripperCommand, MotionPlan, Phase, PhaseName
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_arm_executor.trajectory import TimedPath, time_path
from emd_core.errors import CellError, CollisionError, NoHemError, OutOfReachError
from emd_core.frames import FloatArray
from emd_core.independent_manipulation import HandsManipulation

# A joint nearer to its rest position than this needs no move, radians.
AT_REST = 1e-3
# Reasons that a refusal quotes.
_QUOTED = 6


class ManipulationPlanner:
    """Plans manipulations for a robot whose torso is locked."""

    def __init__(self, robot: RobotModel, config: MotionConfig) -> None:
        """Keep the robot and the configuration."""
        self.robot = robot
        self.config = config

    def plan(
        self,
        manipulation: HandsManipulation,
        silhouette: Silhouette,
        contours: Sequence[HemContour],
        joint_positions: Mapping[str, float],
        avoid_in_table: Sequence[FloatArray] = (),
    ) -> MotionPlan:
        """Plan approach, grasp, carrying, release, retreat and the way home.

        Args:
            manipulation: Grasp points and displacements in the table frame.
            silhouette: The cloth.
            contours: Its outlines.
            joint_positions: Where the robot's joints are, radians; the torso as it is locked.
            avoid_in_table: Places at hems where a grasp has failed, each (2,), metres.

        Raises:
            NoHemError: If no hem lies near a grasp point.
            OutOfReachError: If no candidate is within reach.
            CollisionError: If every candidate within reach touches something.
            InvalidInputError: If a displacement is too short or a joint is missing.
        """
        used = np.array(manipulation.used)
        tasks = [
            GripTask(
                point,
                displacement,
                self._hems(silhouette, contours, point, direction, avoid_in_table),
                silhouette,
                self.config,
            )
            for point, displacement, direction in zip(
                manipulation.grasp_points_in_table[used],
                manipulation.displacements_in_table[used],
                self._asked_directions(manipulation)[used],
                strict=True,
            )
        ]
        rejected: list[CellError] = []
        for searches in assignments(self.robot, tasks):
            for grips in grip_sets(searches, self.config.grasp.max_pairs):
                try:
                    return self._complete(grips, tasks, joint_positions, rejected)
                except (OutOfReachError, CollisionError) as err:
                    rejected.append(_of_arms(err, grips))
            rejected.extend(reason for search in searches for reason in search.rejected)
        raise _refusal(rejected)

    def _hems(
        self,
        silhouette: Silhouette,
        contours: Sequence[HemContour],
        point: FloatArray,
        direction: FloatArray,
        avoid: Sequence[FloatArray],
    ) -> list[Hem]:
        """Find the hems near a point that face a direction (NaN: any).

        None of them is beside what hides the cloth, or where a grasp has failed.
        """
        config = self.config.hem
        found = [
            hem
            for hem in find_hems(contours, point, config.candidates, config)
            if not silhouette.is_hidden(
                hem.point_in_table, hem.outward_normal, config.hidden_reach
            )
        ]
        if not found:
            raise NoHemError(
                f"a hem near ({point[0]:.3f}, {point[1]:.3f}) m is wanted, but something hides "
                "the cloth there, so its end is not known; take that away and look again"
            )
        near = config.failed_radius
        kept = [
            hem
            for hem in found
            if all(np.linalg.norm(hem.point_in_table - place) > near for place in avoid)
        ]
        if not kept:
            raise NoHemError(
                f"another hem near ({point[0]:.3f}, {point[1]:.3f}) m is wanted, since the grasp "
                f"there failed; all {len(found)} are within {near:.3f} m of the failed one"
            )
        if np.isnan(direction).any():
            return kept
        return facing(kept, direction, self.config.grasp.max_asked_turn)

    @staticmethod
    def _asked_directions(manipulation: HandsManipulation) -> FloatArray:
        """One row for each grasp point; NaN where the hand's direction is free."""
        asked = manipulation.grasp_directions_in_table
        return np.full((2, 2), np.nan) if asked is None else asked

    def _complete(
        self,
        grips: Sequence[Grip],
        tasks: Sequence[GripTask],
        joint_positions: Mapping[str, float],
        rejected: Sequence[CellError],
    ) -> MotionPlan:
        """Check the whole motion with these grips, one for each task, and time it."""
        displacements = np.stack([task.displacement_in_table for task in tasks])
        if self.config.grasp.keep_crease:
            points = np.stack([task.point_in_table for task in tasks])
            grasps = [grip.grasp for grip in grips]
            displacements = displacements_keeping_creases(
                displacements, points, grasps, self.config.grasp.jaw_depth
            )
        paths = hand_paths(self.robot, grips, displacements, tasks[0].silhouette, self.config)
        resting = self._resting(paths.arms, joint_positions)
        self._check_contact(paths, resting)
        approach = self._approach(paths, joint_positions)
        home = self._way_home(paths, resting)
        return MotionPlan(
            phases=self._phases(paths, approach, home),
            grasps={grip.arm: grip.grasp for grip in grips},
            via_poses_in_table=dict(zip(paths.arms, paths.via_poses_in_table, strict=True)),
            displacements_in_table=dict(zip(paths.arms, displacements, strict=True)),
            rejected=tuple(str(reason) for reason in rejected),
        )

    def _resting(
        self, used: Sequence[str], joint_positions: Mapping[str, float]
    ) -> dict[str, float]:
        """Give the posture with every arm that is not used at rest."""
        posture = dict(joint_positions)
        for arm in self.robot.arms:
            if arm not in used:
                names = self.robot.joint_names([arm])
                posture.update(zip(names, self.robot.rest_positions([arm]), strict=True))
        return posture

    def _check_contact(self, paths: HandPaths, others: Mapping[str, float]) -> None:
        grasp = self.config.grasp
        for name, path, width in (
            ("lower", paths.lower, grasp.open_width),
            ("insert", paths.insert, grasp.open_width),
            ("carry", paths.carry, grasp.closed_width),
            ("retreat", paths.retreat, grasp.open_width),
        ):
            widths = dict.fromkeys(paths.arms, width)
            _, positions = path.densely(self.robot.collision.path_step)
            rows = self.robot.configurations(others, path.joint_names, positions, widths)
            self.robot.collision.check_path(rows, name)

    def _approach(self, paths: HandPaths, joint_positions: Mapping[str, float]) -> list[JointPath]:
        """Bring the used arms above the hem, and stray ones to rest."""
        strays = tuple(
            arm
            for arm in self.robot.arms
            if arm not in paths.arms and self._strays(arm, joint_positions)
        )
        arms = paths.arms + strays
        goal = np.concatenate([paths.start, *(self.robot.rest_positions([a]) for a in strays)])
        start = self.robot.arm_positions(arms, joint_positions)
        widths = dict.fromkeys(paths.arms, self.config.grasp.open_width)
        move = JointMove("approach", arms, start, goal, joint_positions, widths)
        return plan_joint_move(self.robot, move)

    def _strays(self, arm: str, joint_positions: Mapping[str, float]) -> bool:
        offset = self.robot.arm_positions([arm], joint_positions) - self.robot.rest_positions(
            [arm]
        )
        return bool(np.abs(offset).max() > AT_REST)

    def _way_home(self, paths: HandPaths, others: Mapping[str, float]) -> list[JointPath]:
        widths = dict.fromkeys(paths.arms, self.config.grasp.open_width)
        goal = self.robot.rest_positions(paths.arms)
        move = JointMove("home", paths.arms, paths.end, goal, others, widths)
        return plan_joint_move(self.robot, move)

    def _phases(
        self, paths: HandPaths, approach: Sequence[JointPath], home: Sequence[JointPath]
    ) -> tuple[Phase, ...]:
        grasp, timing = self.config.grasp, self.config.timing
        opened = jaws(paths.arms, grasp.open_width)
        closed = jaws(paths.arms, grasp.closed_width)
        down = (
            *(time_joint_path(self.robot, path) for path in approach),
            time_joint_path(self.robot, paths.lower, timing.lower_speed),
            time_joint_path(self.robot, paths.insert, timing.insert_speed),
        )
        carried = time_joint_path(self.robot, paths.carry, timing.carry_speed)
        risen = time_joint_path(self.robot, paths.retreat, timing.retreat_speed)
        return (
            Phase(PhaseName.APPROACH, down, opened),
            Phase(PhaseName.GRASP, (), closed, grasp.close_time),
            Phase(PhaseName.CARRY, (carried,)),
            Phase(PhaseName.RELEASE, (), opened, grasp.open_time),
            Phase(PhaseName.RETREAT, (risen,)),
            Phase(PhaseName.HOME, tuple(time_joint_path(self.robot, path) for path in home)),
        )


def jaws(arms: Sequence[str], width: float) -> tuple[GripperCommand, ...]:
    """Tell the hands of some arms the same opening, metres."""
    return tuple(GripperCommand(arm, width) for arm in arms)


def time_joint_path(
    robot: RobotModel, path: JointPath, max_speed: float | None = None
) -> TimedPath:
    """Time a path under the limits of its joints; `max_speed` caps the path parameter's."""
    limits = MotionLimits.of(robot.max_velocity(path.joint_names), robot.config.timing)
    return time_path(path, limits, max_speed)


def _of_arms(err: CellError, grips: Sequence[Grip]) -> CellError:
    hands = " and ".join(
        f"{grip.arm} arm at ({grip.grasp.position_in_table[0]:.3f}, "
        f"{grip.grasp.position_in_table[1]:.3f}) m"
        for grip in grips
    )
    return type(err)(f"{hands}: {err}")


def _refusal(rejected: Sequence[CellError]) -> CellError:
    """Put all reasons into one error; a collision outranks being out of reach."""
    collided = any(isinstance(reason, CollisionError) for reason in rejected)
    kind = CollisionError if collided else OutOfReachError
    unique = list(dict.fromkeys(str(reason) for reason in rejected))
    quoted = "; ".join(unique[:_QUOTED])
    more = f"; and {len(unique) - _QUOTED} more" if len(unique) > _QUOTED else ""
    return kind(f"no arm can carry out this manipulation: {quoted}{more}")
