"""Inverse kinematics of the arms of any URDF: all branches, within the limits, or how near.

Pinocchio reads the URDF and locks every joint that is not the arm's; the chain that is left goes
to compiled kernels. Poses are 4 x 4 matrices `tool to base`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from emd_arm_executor import chain_kernels
from emd_arm_executor.arm_group import ArmGroup, reduced_model
from emd_arm_executor.config import KinematicsConfig
from emd_arm_executor.serial_chain import SerialChain
from emd_core.errors import OutOfReachError
from emd_core.frames import FloatArray

# A lever that turns an angle into a length, so that the two parts of a pose's error can be added.
_METRES_PER_RADIAN = 0.2
# Solutions that differ by less in every joint are one, radians.
_SAME = 0.05


@dataclass(frozen=True)
class Attempt:
    """Where one descent of the inverse kinematics ended.

    Attributes:
        positions: Joint positions, shape (n,), radians, inside the limits.
        distance: Distance of the tool's origin from the target, metres.
        angle: Angle of the tool's rotation from the target's, radians.
        solved: Whether both are within the configured tolerance.
    """

    positions: FloatArray
    distance: float
    angle: float
    solved: bool

    @property
    def cost(self) -> float:
        """Distance plus the angle on a lever of 0.2 m, metres."""
        return self.distance + _METRES_PER_RADIAN * self.angle


class ArmKinematics:
    """Forward and inverse kinematics of one arm, all other joints locked."""

    def __init__(
        self,
        model: pin.Model,
        group: ArmGroup,
        locked_positions: FloatArray,
        config: KinematicsConfig | None = None,
    ) -> None:
        """Reduce the model to the arm.

        Args:
            model: The whole robot.
            group: The arm's joints, in the order of the chain, and its tool frame.
            locked_positions: Configuration of the whole robot, shape (nq,), radians.
            config: Tolerances and restarts.

        Raises:
            InvalidInputError: If a joint or the tool frame is not in the model, or the joints
                are no chain of revolute joints.
        """
        self.group = group
        self.config = config or KinematicsConfig()
        reduced = reduced_model(model, group, locked_positions)
        self.chain = SerialChain.from_model(reduced, group.tool_frame)
        self.lower, self.upper = self.chain.limits
        self.max_velocity = np.array(reduced.upperVelocityLimit)
        rng = np.random.default_rng(self.config.seed)
        span = (self.config.pool, len(group.joint_names))
        self._pool = rng.uniform(self.lower, self.upper, span)
        self._pool_poses = self.chain.forward(self._pool)

    @property
    def name(self) -> str:
        """Name of the arm."""
        return self.group.name

    def forward(self, positions: FloatArray) -> FloatArray:
        """Give the tool's pose in the base frame, shape (4, 4), for joint positions (n,)."""
        return np.asarray(self.chain.forward(np.asarray(positions)[None])[0])

    def jacobian(self, positions: FloatArray) -> FloatArray:
        """Give the geometric Jacobian of the tool, shape (6, n): linear, then angular.

        Both velocities are expressed in the tool frame.
        """
        to_tool = self.forward(positions)[:3, :3].T
        in_base = self.chain.jacobian(positions)
        return np.concatenate([to_tool @ in_base[:3], to_tool @ in_base[3:]])

    def manipulability(self, positions: FloatArray) -> float:
        """Give the root of det(J J^T) (Yoshikawa, 1985), metres^3 for six joints; 0: singular."""
        jacobian = self.chain.jacobian(positions)
        return float(np.sqrt(max(np.linalg.det(jacobian @ jacobian.T), 0.0)))

    def limit_distance(self, positions: FloatArray) -> float:
        """Give the distance of the joint that is nearest to one of its limits, radians."""
        return float(np.minimum(positions - self.lower, self.upper - positions).min())

    def posture_cost(self, positions: FloatArray, rest: FloatArray) -> float:
        """Rate a posture: travel from rest, more near a joint limit or a singularity, radians.

        Args:
            positions: Joint positions, shape (n,), radians.
            rest: Where the arm comes from, shape (n,), radians.
        """
        config = self.config
        cramped = 1.0 - self.limit_distance(positions) / config.limit_clearance
        clumsy = 1.0 - self.manipulability(positions) / config.dexterity_clearance
        penalty = config.clearance_weight * (max(cramped, 0.0) + max(clumsy, 0.0))
        return float(np.abs(positions - rest).max()) + penalty

    def descend(self, transform_tool_to_base: FloatArray, seed: FloatArray) -> Attempt:
        """Walk from `seed` to the target by damped least squares inside the joint limits.

        Each step solves the linearised problem on the joints that are free to move: a joint that
        stands at a limit and would be pushed through it leaves the active set. The damping falls
        with the error (Sugihara, 2011), so the last steps are those of Newton's method.

        Args:
            transform_tool_to_base: Target, shape (4, 4).
            seed: Start, shape (n,), radians; clipped to the limits.
        """
        config = self.config
        target = np.ascontiguousarray(transform_tool_to_base, dtype=np.float64)
        start = np.ascontiguousarray(seed, dtype=np.float64)
        settings = np.array(
            [
                config.iterations,
                config.patience,
                config.damping,
                config.max_iteration_step,
                config.position_tolerance,
                config.rotation_tolerance,
                _METRES_PER_RADIAN,
            ]
        )
        positions, distance, angle = chain_kernels.descend(
            self.chain.links, self.chain.limits, target, start, settings
        )
        solved = distance < config.position_tolerance and angle < config.rotation_tolerance
        return Attempt(positions, distance, angle, solved)

    def solve(self, transform_tool_to_base: FloatArray, seed: FloatArray) -> FloatArray:
        """Find joint positions for a tool pose, first from `seed`, then from the restarts.

        Returns:
            Joint positions, shape (n,), radians, within the limits.

        Raises:
            OutOfReachError: If no start leads there; names the pose and the nearest one reached.
        """
        for positions in self.solutions(transform_tool_to_base, (seed,)):
            return positions
        raise self.out_of_reach(transform_tool_to_base, (seed,))

    def solutions(
        self,
        transform_tool_to_base: FloatArray,
        seeds: Sequence[FloatArray] = (),
        restarts: int | None = None,
    ) -> Iterator[FloatArray]:
        """Yield distinct joint positions for a tool pose, those near the seeds first.

        The restarts are those of a fixed random pool whose tools are nearest to the target. With
        the configured number of them every branch of HIRO's arms is found, except some that meet
        another at a singularity (a test compares with an exact search).

        Args:
            transform_tool_to_base: Target, shape (4, 4).
            seeds: Starts that come before those of the pool, each (n,), radians.
            restarts: How many starts of the pool to use; as configured if None.
        """
        found: list[FloatArray] = []
        for seed in (*seeds, *self._nearest_in_pool(transform_tool_to_base, restarts)):
            attempt = self.descend(transform_tool_to_base, seed)
            known = (np.abs(attempt.positions - other).max() < _SAME for other in found)
            if attempt.solved and not any(known):
                found.append(attempt.positions)
                yield attempt.positions

    def nearest(
        self, transform_tool_to_base: FloatArray, seeds: Sequence[FloatArray] = ()
    ) -> Attempt:
        """Find the posture whose tool comes nearest to a pose, a solution if there is one.

        Args:
            transform_tool_to_base: Target, shape (4, 4).
            seeds: Starts beside those of the pool, each (n,), radians.
        """
        pool = self._nearest_in_pool(transform_tool_to_base, self.config.report_restarts)
        starts = (*seeds, *pool)
        attempts = (self.descend(transform_tool_to_base, start) for start in starts)
        return min(attempts, key=lambda attempt: attempt.cost)

    def out_of_reach(
        self, transform_tool_to_base: FloatArray, seeds: Sequence[FloatArray] = ()
    ) -> OutOfReachError:
        """Describe how near the arm comes to a pose that it cannot take, and where that is."""
        nearest = self.nearest(transform_tool_to_base, seeds)
        reached = self.forward(nearest.positions)[:3, 3]
        return OutOfReachError(
            f"the {self.name} arm should bring its hand to "
            f"{_place(transform_tool_to_base[:3, 3])} in the base frame; it comes within "
            f"{nearest.distance * 1e3:.1f} mm and {np.rad2deg(nearest.angle):.1f} degrees, at "
            f"{_place(reached)}; choose a nearer point or another direction"
        )

    def _nearest_in_pool(
        self, transform_tool_to_base: FloatArray, count: int | None
    ) -> FloatArray:
        """Give the random configurations whose tool is nearest to a pose, shape (count, n)."""
        count = self.config.restarts if count is None else count
        target = np.ascontiguousarray(transform_tool_to_base, dtype=np.float64)
        costs = chain_kernels.pose_costs(self._pool_poses, target, _METRES_PER_RADIAN)
        if count >= len(costs):
            return self._pool
        nearest = np.argpartition(costs, count)[:count]
        return self._pool[nearest[np.argsort(costs[nearest], kind="stable")]]


def _place(point: FloatArray) -> str:
    return "({:.3f}, {:.3f}, {:.3f}) m".format(*point)
