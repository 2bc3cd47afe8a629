"""Motion of one path parameter over time in pieces of constant jerk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ruckig import ControlInterface, InputParameter, Ruckig, RuckigError, Trajectory

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class PathState:
    """Where a path parameter is and how it moves.

    Attributes:
        position: The parameter.
        velocity: Its first derivative, 1/s.
        acceleration: Its second derivative, 1/s^2.
    """

    position: float
    velocity: float
    acceleration: float


@dataclass(frozen=True)
class PathProfile:
    """Pieces of constant jerk, one after the other.

    Attributes:
        starts: Times at which the K pieces begin, shape (K,), seconds, from 0.
        jerks: Shape (K,).
        accelerations: At the beginnings, shape (K,).
        velocities: At the beginnings, shape (K,).
        positions: At the beginnings, shape (K,).
        duration: Time at which the last piece ends, seconds.
    """

    starts: FloatArray
    jerks: FloatArray
    accelerations: FloatArray
    velocities: FloatArray
    positions: FloatArray
    duration: float

    @classmethod
    def standing(cls, position: float = 0.0) -> PathProfile:
        """Stay at a position."""
        return cls._integrate(np.zeros(0), np.zeros(0), PathState(position, 0.0, 0.0))

    @classmethod
    def rest_to_rest(
        cls, length: float, speed: float, acceleration: float, jerk: float, start: float = 0.0
    ) -> PathProfile:
        """Go from `start` to `length` in the shortest time within the limits (Ruckig)."""
        request = InputParameter(1)
        request.current_position, request.target_position = [start], [length]
        request.max_velocity = [speed]
        request.max_acceleration = [acceleration]
        request.max_jerk = [jerk]
        return cls._calculate(request, PathState(start, 0.0, 0.0))

    @classmethod
    def to_rest(cls, state: PathState, acceleration: float, jerk: float) -> PathProfile:
        """Come to rest from any state in the shortest time within the limits (Ruckig)."""
        request = InputParameter(1)
        request.control_interface = ControlInterface.Velocity
        request.current_position = [state.position]
        request.current_velocity = [state.velocity]
        request.current_acceleration = [state.acceleration]
        request.target_velocity, request.target_acceleration = [0.0], [0.0]
        # What the motion has already is allowed: Ruckig would first leave it in haste.
        request.max_acceleration = [max(acceleration, abs(state.acceleration))]
        request.max_jerk = [jerk]
        return cls._calculate(request, state)

    @classmethod
    def _calculate(cls, request: InputParameter, start: PathState) -> PathProfile:
        trajectory = Trajectory(1)
        try:
            Ruckig(1).calculate(request, trajectory)
        except RuckigError as err:
            raise InvalidInputError(
                f"a motion along the path is wanted, Ruckig finds none; check the limits: {err}"
            ) from err
        profile = trajectory.profiles[0][0]
        pieces = (profile.brake, profile, profile.accel)
        times = np.concatenate([np.asarray(piece.t) for piece in pieces])
        jerks = np.concatenate([np.asarray(piece.j) for piece in pieces])
        return cls._integrate(times, jerks, start)

    @classmethod
    def _integrate(cls, times: FloatArray, jerks: FloatArray, start: PathState) -> PathProfile:
        """Chain pieces of these lengths and jerks from a state; empty ones are left out."""
        kept = times > 0.0
        times, jerks = times[kept], jerks[kept]
        if len(times) == 0:
            times, jerks = np.zeros(1), np.zeros(1)
        states = [(start.position, start.velocity, start.acceleration)]
        for h, j in zip(times.tolist(), jerks.tolist(), strict=True):
            p, v, a = states[-1]
            states.append(
                (
                    p + h * (v + h * (a / 2.0 + h * j / 6.0)),
                    v + h * (a + h * j / 2.0),
                    a + h * j,
                )
            )
        starts = np.append(0.0, np.cumsum(times))
        positions, velocities, accelerations = np.array(states[:-1]).T
        return cls(starts[:-1], jerks, accelerations, velocities, positions, float(starts[-1]))

    def slowed(self, factor: float) -> PathProfile:
        """Give the same motion, `factor` times as long."""
        return PathProfile(
            self.starts * factor,
            self.jerks / factor**3,
            self.accelerations / factor**2,
            self.velocities / factor,
            self.positions,
            self.duration * factor,
        )

    def sample(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Give position, velocity, acceleration and jerk at times (T,), each (T,).

        Before the start and after the end the states there hold.
        """
        clipped = np.clip(times, 0.0, self.duration)
        piece = np.maximum(np.searchsorted(self.starts, clipped, side="right") - 1, 0)
        h = clipped - self.starts[piece]
        j, a = self.jerks[piece], self.accelerations[piece]
        v, p = self.velocities[piece], self.positions[piece]
        return (
            p + h * (v + h * (a / 2.0 + h * j / 6.0)),
            v + h * (a + h * j / 2.0),
            a + h * j,
            j,
        )
