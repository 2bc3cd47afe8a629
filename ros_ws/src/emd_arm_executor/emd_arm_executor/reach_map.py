"""The part of the table in which each arm can grasp and let go, sampled by trying it out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from emd_arm_executor.grasp import GraspPose
from emd_arm_executor.hem import Hem
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import InvalidInputError, OutOfReachError
from emd_core.frames import FloatArray
from emd_core.reach_map import ReachMap

# What a joint may turn between the coarse poses of a hand's way, radians.
_JOINT_STEP = 0.8


def compute_reach_map(
    robot: RobotModel, on_progress: Callable[[int, int], None] | None = None
) -> ReachMap:
    """Try grasps and releases all over the table, in all directions, with the torso at rest.

    A grasp counts if an arm takes a gripping posture at a hem there, with any of the configured
    tilts, comes down and under the hem to it, rises to the lift height, and touches nothing. A
    release counts if the same hand can stand over the table with cloth below it, open and rise.

    Args:
        robot: The robot.
        on_progress: Called with the number of columns done and their total.
    """
    reach = robot.config.reach
    count = int(round(2.0 * reach.extent / reach.map_step))
    axis: FloatArray = np.linspace(-reach.extent, reach.extent, count + 1)
    yaws: FloatArray = np.arange(reach.directions) * np.float64(2.0 * np.pi / reach.directions)
    shape = (len(robot.arms), len(yaws), len(axis), len(axis))
    grasp, release = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    columns = [(a, k) for a in range(shape[0]) for k in range(shape[1])]
    for done, (a, k) in enumerate(columns):
        prober = _Prober(robot, tuple(robot.arms)[a], float(yaws[k]))
        for i, x in enumerate(axis):
            for j, y in enumerate(axis):
                point = np.array([x, y])
                grasp[a, k, i, j] = prober.grasps(point)
                release[a, k, i, j] = prober.releases(point)
        if on_progress is not None:
            on_progress(done + 1, len(columns))
    return ReachMap(tuple(robot.arms), axis, yaws, grasp, release, identity(robot))


def cached_reach_map(
    robot: RobotModel, folder: Path, on_progress: Callable[[int, int], None] | None = None
) -> ReachMap:
    """Give the map of this cell, computed once and kept as a file in a folder.

    Args:
        robot: The robot.
        folder: Where maps are kept; one file for each cell.
        on_progress: As for `compute_reach_map`.
    """
    path = folder / f"reach-{identity(robot)}.npz"
    if path.exists():
        return ReachMap.load(path)
    found = compute_reach_map(robot, on_progress)
    try:
        found.save(path)
    except InvalidInputError as err:
        raise InvalidInputError(f"{err}; name another folder for reach maps") from err
    return found


def identity(robot: RobotModel) -> str:
    """Digest of all that a map depends on: model, table, limits and figures of the motion."""
    description = robot.description
    digest = hashlib.sha256(description.urdf.read_bytes())
    for item in (
        description.transform_table_to_base,
        description.table_centre_in_base,
        description.table_size,
        np.array([arm.chain.limits for arm in robot.arms.values()]),
        sorted(description.rest.items()),
        sorted((*sorted(pair), margin) for pair, margin in description.pair_margins.items()),
        robot.config,
    ):
        digest.update(repr(np.round(item, 9) if isinstance(item, np.ndarray) else item).encode())
    return digest.hexdigest()[:16]


class _Prober:
    """Tries postures of one arm whose hand comes in one direction."""

    def __init__(self, robot: RobotModel, arm: str, yaw: float) -> None:
        self._robot, self._arm = robot, arm
        self._names = robot.joint_names([arm])
        self._seed = robot.rest_positions([arm])
        self._direction = np.array([np.cos(yaw), np.sin(yaw)])

    def grasps(self, point: FloatArray) -> bool:
        """Whether a hem at a point (2,) can be grasped and lifted."""
        grasp, path = self._robot.config.grasp, self._robot.config.path
        rise = path.lift_height - grasp.grip_height
        for pose, positions in self._postures(point, grasp.grip_height):
            up = [(0.0, 0.0), (0.0, rise / 2.0), (0.0, rise)]
            if not self._is_free(pose, positions, up, grasp.closed_width):
                continue
            for distance in grasp.pre_grasp_distances:
                back, high = distance + grasp.insertion, grasp.hover_clearance
                down = [(0.0, 0.0), (back / 2.0, 0.0), (back, 0.0), (back, high / 2), (back, high)]
                if self._is_free(pose, positions, down, grasp.open_width):
                    return True
        return False

    def releases(self, point: FloatArray) -> bool:
        """Whether the hand can let go over a point (2,) and rise."""
        grasp, path = self._robot.config.grasp, self._robot.config.path
        height = grasp.grip_height + path.release_clearance
        rise = path.lift_height - height
        for pose, positions in self._postures(point, height):
            up = [(0.0, 0.0), (0.0, rise / 2.0), (0.0, rise)]
            opened = self._is_free(pose, positions, up[:2], grasp.open_width)
            if opened and self._is_free(pose, positions, up, grasp.closed_width):
                return True
        return False

    def _postures(
        self, point: FloatArray, height: float
    ) -> Iterator[tuple[GraspPose, FloatArray]]:
        config, kinematics = self._robot.config, self._robot.arms[self._arm]
        hem = Hem(point, -self._direction, 0.0, True, (0, 0))
        for tilt in config.grasp.tilts:
            for flipped in (False, True):
                held = np.array([*point, height])
                pose = GraspPose(hem, held, self._direction, tilt, flipped)
                target = self._robot.transform_table_to_base @ pose.transform_tool_to_table
                restarts = config.kinematics.grasp_restarts
                for positions in kinematics.solutions(target, (self._seed,), restarts):
                    yield pose, positions

    def _is_free(
        self,
        pose: GraspPose,
        positions: FloatArray,
        way: Sequence[tuple[float, float]],
        width: float,
    ) -> bool:
        """Whether the arm follows a way of (retraction, rise) without touching anything."""
        to_base = self._robot.transform_table_to_base
        poses = to_base @ np.stack([pose.at(*place) for place in way])
        try:
            path = follow_poses(self._robot.arms[self._arm], poses, positions, _JOINT_STEP)
        except OutOfReachError:
            return False
        rows = self._robot.configurations({}, self._names, path, {self._arm: width})
        return all(self._robot.collision.contact(q) is None for q in rows)
