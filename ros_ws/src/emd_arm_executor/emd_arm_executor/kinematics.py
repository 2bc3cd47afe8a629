"""Forward and inverse kinematics of the arms of any URDF, with Pinocchio.

Each arm is a reduced model in which every other joint is locked, so that one iteration of the
inverse kinematics touches only the arm's own joints. Poses are 4 x 4 matrices `tool to base`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emd_arm_executor.config import KinematicsConfig
from emd_core.errors import InvalidInputError, OutOfReachError
from emd_core.frames import FloatArray

# A lever that turns an angle into a length, so that the two parts of a pose's error can be added.
_METRES_PER_RADIAN = 0.2
_LOCAL = pin.ReferenceFrame.LOCAL
_DIAGONAL: tuple[NDArray[np.intp], NDArray[np.intp]] = (np.arange(6), np.arange(6))


@dataclass(frozen=True)
class ArmGroup:
    """The joints of one arm and the frame that its hand works with.

    Attributes:
        name: Name of the arm, for example "left".
        joint_names: The arm's joints from the shoulder to the wrist.
        tool_frame: Frame between the fingertips; z out of the fingers, x along the jaws' opening.
    """

    name: str
    joint_names: tuple[str, ...]
    tool_frame: str


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
            InvalidInputError: If a joint or the tool frame is not in the model.
        """
        _check_group(model, group)
        self.group = group
        self.config = config or KinematicsConfig()
        locked = [
            i for i in range(1, model.njoints) if str(model.names[i]) not in group.joint_names
        ]
        self._model = pin.buildReducedModel(model, locked, locked_positions)
        if tuple(str(name) for name in self._model.names[1:]) != group.joint_names:
            raise InvalidInputError(
                f"the joints of arm {group.name} must be listed from the shoulder to the wrist, "
                f"got {group.joint_names}, the model has {tuple(self._model.names[1:])}"
            )
        self._data = self._model.createData()
        self._tool = self._model.getFrameId(group.tool_frame)
        self.lower = np.array(self._model.lowerPositionLimit)
        self.upper = np.array(self._model.upperPositionLimit)
        self.max_velocity = np.array(self._model.upperVelocityLimit)
        rng = np.random.default_rng(self.config.seed)
        span = (self.config.pool, len(group.joint_names))
        self._pool = rng.uniform(self.lower, self.upper, span)
        self._pool_poses = np.array([self.forward(positions) for positions in self._pool])

    @property
    def name(self) -> str:
        """Name of the arm."""
        return self.group.name

    def forward(self, positions: FloatArray) -> FloatArray:
        """Give the tool's pose in the base frame, shape (4, 4), for joint positions (n,)."""
        pin.framesForwardKinematics(self._model, self._data, positions)
        return np.array(self._data.oMf[self._tool].homogeneous)

    def jacobian(self, positions: FloatArray) -> FloatArray:
        """Give the geometric Jacobian of the tool, shape (6, n): linear, then angular.

        Both velocities are expressed in the tool frame.
        """
        return np.array(
            pin.computeFrameJacobian(self._model, self._data, positions, self._tool, _LOCAL)
        )

    def descend(self, transform_tool_to_base: FloatArray, seed: FloatArray) -> Attempt:
        """Walk from `seed` to the target by damped least squares inside the joint limits.

        Each step solves the linearised problem on the joints that are free to move: a joint that
        stands at a limit and would be pushed through it leaves the active set. The damping falls
        with the error (Sugihara, 2011), so the last steps are those of Newton's method.

        Args:
            transform_tool_to_base: Target, shape (4, 4).
            seed: Start, shape (n,), radians; clipped to the limits.
        """
        target = pin.SE3(transform_tool_to_base[:3, :3], transform_tool_to_base[:3, 3])
        positions = np.clip(seed, self.lower, self.upper)
        best, stalled = Attempt(positions, np.inf, np.inf, False), 0
        for _ in range(self.config.iterations):
            error, jacobian = self._linearise(positions, target)
            attempt = self._rate(positions, error)
            if attempt.solved:
                return attempt
            stalled = 0 if attempt.cost < 0.97 * best.cost else stalled + 1
            if attempt.cost < best.cost:
                best = attempt
            if stalled > self.config.patience:
                break
            positions = self._step(positions, error, jacobian)
        return best

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

        The restarts are those of a fixed random pool whose tools are nearest to the target: of
        1000 random reachable poses they solve all, four fifths at the first try.

        Args:
            transform_tool_to_base: Target, shape (4, 4).
            seeds: Starts that come before those of the pool, each (n,), radians.
            restarts: How many starts of the pool to use; as configured if None.
        """
        found: list[FloatArray] = []
        for seed in (*seeds, *self._nearest_in_pool(transform_tool_to_base, restarts)):
            attempt = self.descend(transform_tool_to_base, seed)
            known = (np.abs(attempt.positions - other).max() < 0.05 for other in found)
            if attempt.solved and not any(known):
                found.append(attempt.positions)
                yield attempt.positions

    def out_of_reach(
        self, transform_tool_to_base: FloatArray, seeds: Sequence[FloatArray] = ()
    ) -> OutOfReachError:
        """Describe how near the arm comes to a pose that it cannot take."""
        pool = self._nearest_in_pool(transform_tool_to_base, self.config.report_restarts)
        starts = (*seeds, *pool)
        nearest = min(
            (self.descend(transform_tool_to_base, start) for start in starts),
            key=lambda attempt: attempt.cost,
        )
        x, y, z = transform_tool_to_base[:3, 3]
        return OutOfReachError(
            f"the {self.name} arm should bring its hand to ({x:.3f}, {y:.3f}, {z:.3f}) m in the "
            f"base frame; it comes within {nearest.distance * 1e3:.1f} mm and "
            f"{np.rad2deg(nearest.angle):.1f} degrees; choose a nearer point or another direction"
        )

    def _nearest_in_pool(
        self, transform_tool_to_base: FloatArray, count: int | None
    ) -> FloatArray:
        """Give the random configurations whose tool is nearest to a pose, shape (count, n)."""
        count = self.config.restarts if count is None else count
        offset = self._pool_poses[:, :3, 3] - transform_tool_to_base[:3, 3]
        rotations = self._pool_poses[:, :3, :3]
        # 3 - trace(R_a^T R_b) = 2 (1 - cos(angle)), about the squared angle.
        angle = 3.0 - np.einsum("nij,ij->n", rotations, transform_tool_to_base[:3, :3])
        cost = (offset**2).sum(axis=1) + _METRES_PER_RADIAN**2 * angle
        return self._pool[np.argsort(cost, kind="stable")[:count]]

    def _linearise(self, positions: FloatArray, target: pin.SE3) -> tuple[FloatArray, FloatArray]:
        """Give the pose error (6,) in the tool frame and its Jacobian with respect to joints."""
        pin.computeJointJacobians(self._model, self._data, positions)
        pose = pin.updateFramePlacement(self._model, self._data, self._tool)
        jacobian = pin.getFrameJacobian(self._model, self._data, self._tool, _LOCAL)
        error_pose = pose.actInv(target)
        error = np.array(pin.log6(error_pose).vector)
        return error, pin.Jlog6(error_pose.inverse()) @ jacobian

    def _rate(self, positions: FloatArray, error: FloatArray) -> Attempt:
        distance = float(np.sqrt(error[:3] @ error[:3]))
        angle = float(np.sqrt(error[3:] @ error[3:]))
        config = self.config
        solved = distance < config.position_tolerance and angle < config.rotation_tolerance
        return Attempt(positions, distance, angle, solved)

    def _step(self, positions: FloatArray, error: FloatArray, jacobian: FloatArray) -> FloatArray:
        """Take one damped step on the joints that are not pushed through a limit."""
        free = np.ones(len(positions), dtype=bool)
        damping = self.config.damping * (error @ error) + 1e-12
        change = np.zeros_like(positions)
        for _ in range(len(positions)):
            active = jacobian * free
            normal = active @ active.T
            normal[_DIAGONAL] += damping
            change = active.T @ np.linalg.solve(normal, error)
            ahead = positions + change
            blocked = free & (
                ((positions >= self.upper) & (ahead > self.upper))
                | ((positions <= self.lower) & (ahead < self.lower))
            )
            if not blocked.any():
                break
            free &= ~blocked
        largest = float(np.abs(change).max())
        if largest > self.config.max_iteration_step:
            change *= self.config.max_iteration_step / largest
        return np.clip(positions + change, self.lower, self.upper)


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
