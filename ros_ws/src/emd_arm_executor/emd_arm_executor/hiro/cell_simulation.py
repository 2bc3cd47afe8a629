"""Robot and cloth simulated in lockstep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.hiro.description import HANDS, JOINT_GROUPS, JOINT_NAMES, OBSERVE, Posture
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory, TrajectoryFollower
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.simulated_cloth import SimulatedCloth


@dataclass(frozen=True)
class CellSimulationConfig:
    """When a hand counts as closed and as open.

    Attributes:
        grasp_width: A closing hand takes the cloth when the jaws' opening falls below this,
            metres; more than a pile of layers is thick.
        release_width: An opening hand lets go when the opening rises above this, metres.
    """

    grasp_width: float = 0.012
    release_width: float = 0.015

    def __post_init__(self) -> None:
        """Check the order of the widths.

        Raises:
            InvalidInputError: If not 0 < grasp_width < release_width.
        """
        if not 0 < self.grasp_width < self.release_width:
            raise InvalidInputError(
                f"0 < grasp_width < release_width is wanted, got {self.grasp_width} and "
                f"{self.release_width}"
            )


class CellSimulation:
    """The cell: servos follow trajectories, hands take hold of the cloth, time goes on.

    A closing hand holds what its fingers enclose. The jaws of a hand that holds cloth stop at the
    cloth's thickness, as real ones do, so that the measured width tells whether a grasp succeeded
    and whether the cloth has slipped out since.
    """

    def __init__(
        self,
        world: HiroWorld,
        cloth: SimulatedCloth,
        config: CellSimulationConfig | None = None,
    ) -> None:
        """Couple a robot world and a cloth on its table.

        Args:
            world: The robot; its `geometry` says where the table frame is.
            cloth: The cloth, in the table frame.
            config: When hands count as closed and open.
        """
        self.world = world
        self.cloth = cloth
        self.config = config or CellSimulationConfig()
        self.time = 0.0
        self._remainder = 0.0
        self._closed = [world.gripper_width(hand) < self.config.grasp_width for hand in (0, 1)]
        self._opened = [world.gripper_width(hand) for hand in (0, 1)]
        self._followers: dict[str, TrajectoryFollower] = {}
        self._hold_here()

    @property
    def held_vertices(self) -> tuple[int, int]:
        """How many vertices of the cloth the left and the right hand hold."""
        return self.cloth.held_count(0), self.cloth.held_count(1)

    def follow(
        self, group: str, trajectory: CommandedTrajectory, start_time: float | None = None
    ) -> None:
        """Let one joint group follow a trajectory.

        Args:
            group: Name of the joint group.
            trajectory: Of exactly the group's joints, in any order.
            start_time: When it begins, simulated seconds; now if None. Until then the joints stay
                at its first point.

        Raises:
            InvalidInputError: If the group is unknown or the trajectory is of other joints.
        """
        self._follower(group).start(trajectory, self.time if start_time is None else start_time)

    def hold(self, group: str) -> None:
        """Stop one joint group where its trajectory has got to."""
        follower = self._follower(group)
        follower.hold(follower.sample(self.time)[0])

    def is_moving(self, group: str) -> bool:
        """Whether the group's trajectory still goes on."""
        return self._follower(group).is_active(self.time)

    def desired(self) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities that the trajectories want now, each (23,), rad and rad/s."""
        samples = [self._followers[group].sample(self.time) for group in JOINT_GROUPS]
        return np.concatenate([s[0] for s in samples]), np.concatenate([s[1] for s in samples])

    def step(self, duration: float) -> int:
        """Simulate whole time steps of the world; what is left over counts for the next call.

        Args:
            duration: Seconds, >= 0.

        Returns:
            How many time steps were made.

        Raises:
            InvalidInputError: If the duration is negative or not finite.
        """
        if not np.isfinite(duration) or duration < 0:
            raise InvalidInputError(f"a duration of at least 0 s is wanted, got {duration}")
        time_step = self.world.config.time_step
        self._remainder += duration
        count = int(self._remainder / time_step + 1e-6)
        for _ in range(count):
            self._advance(time_step)
        self._remainder -= count * time_step
        return count

    def replace_cloth(self, cloth: SimulatedCloth) -> None:
        """Put another cloth on the table; hands let go of the old one."""
        self.cloth = cloth

    def reset(self, posture: Posture = OBSERVE) -> None:
        """Put the robot in a posture at once and let go of the cloth; time goes on."""
        for hand in (0, 1):
            self.cloth.release(hand)
        self.world.reset(posture)
        self._closed = [self.world.gripper_width(h) < self.config.grasp_width for h in (0, 1)]
        self._hold_here()

    def _advance(self, time_step: float) -> None:
        self.time += time_step
        self.world.set_all_joint_targets(self._stop_jaws_at_cloth(self.desired()[0]))
        self.world.step()
        for hand in (0, 1):
            self._update_grasp(hand)
        held = self.held_vertices
        if any(held) or not self.cloth.settled:
            for hand in (0, 1):
                if held[hand]:
                    self.cloth.move_hand(hand, self.world.tool_transform_in_table(hand))
            self.cloth.advance(time_step)

    def _update_grasp(self, hand: int) -> None:
        width = self.world.gripper_width(hand)
        if self._closed[hand]:
            if width > self.config.release_width:
                self._closed[hand], self._opened[hand] = False, width
                self.cloth.release(hand)
            return
        self._opened[hand] = max(self._opened[hand], width)
        if width < self.config.grasp_width:
            self._closed[hand] = True
            jaws = self.world.gripper.enclosed(self._opened[hand], width)
            self.cloth.grasp(hand, self.world.tool_transform_in_table(hand), jaws)

    def _stop_jaws_at_cloth(self, targets: FloatArray) -> FloatArray:
        gripper = self.world.gripper
        for hand, name in enumerate(HANDS):
            if not self.cloth.held_count(hand):
                continue
            joints, thickness = _indices(f"{name}_gripper"), self.cloth.thickness
            if gripper.width_from_joints(targets[joints]) < thickness:
                targets[joints] = gripper.joints_from_width(thickness)
        return targets

    def _hold_here(self) -> None:
        positions = self.world.joint_setpoints
        for name, group in JOINT_GROUPS.items():
            self._followers[name] = TrajectoryFollower(group.joints, positions[_indices(name)])

    def _follower(self, group: str) -> TrajectoryFollower:
        if group not in self._followers:
            raise InvalidInputError(
                f"a joint group of {sorted(self._followers)} is wanted, got {group!r}"
            )
        return self._followers[group]


def _indices(group: str) -> list[int]:
    return [_INDEX[name] for name in JOINT_GROUPS[group].joints]


_INDEX: Mapping[str, int] = {name: index for index, name in enumerate(JOINT_NAMES)}
