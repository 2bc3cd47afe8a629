"""The simulated cloth: a sheet on the desk, held by up to two hands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.diagnostics import ClothDiagnostics, diagnose
from emd_cloth_sim.hand import Hand, check_transform
from emd_cloth_sim.hinges import hinge_angles
from emd_cloth_sim.mesh import build_mesh, flat_positions, pair_lengths
from emd_cloth_sim.step_data import (
    CLEAN,
    IN_ZONES,
    UNBOUNDED,
    UNSEEN,
    ClothState,
    Held,
    constraints_of,
    contact_memory,
    step_settings,
)
from emd_cloth_sim.xpbd import advance_step, undo
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform, transform_points
from emd_core.simulated_cloth import Jaws

# Substeps of the second attempt over those of the first, and so on.
REFINEMENT = 1.5
# A vertex that is wedged in a pile may tremble for ever; so few do not keep the cloth awake.
MAX_FAST_SHARE = 1e-3


@dataclass(frozen=True)
class ClothMoment:
    """A cloth that no hand holds, at one moment; made by `Cloth.remember`.

    Attributes:
        position: Vertices (V, 3), metres.
        velocity: Likewise, m/s.
        rest_shape: Lengths and angles at rest, which are a plastic cloth's memory.
        clean: Whether the cloth passes nowhere through itself.
    """

    position: NDArray[np.float32]
    velocity: NDArray[np.float32]
    rest_shape: tuple[NDArray[Any], ...]
    clean: bool


class Cloth:
    """A rectangular sheet simulated by small-step XPBD; `emd_core.simulated_cloth.SimulatedCloth`.

    Deterministic: the same calls give bit-identical positions on the same machine.

    Attributes:
        config: The sheet and how it is simulated.
        mesh: The sheet's mesh.
        refinement: How often the number of substeps is multiplied by 1.5.
    """

    def __init__(self, config: ClothConfig | None = None) -> None:
        """Lay the cloth flat, centred and axis-parallel on the desk, at rest."""
        self.config = config or ClothConfig()
        self.mesh = build_mesh(self.config.vertices, self.config.spacing)
        flat = flat_positions(self.config.vertices, self.config.side_lengths)
        flat[:, 2] = self.config.rest_height
        self._position = flat.astype(np.float32)
        self._velocity = np.zeros_like(self._position)
        self._state = ClothState(
            self._position,
            self._position.copy(),
            self._position.copy(),
            self._velocity,
            self._position.copy(),
        )
        self._constraints = constraints_of(self.mesh, self.config)
        self._memory = contact_memory(self.config)
        self._memory.counts[CLEAN] = 1.0
        self._growth = 1
        self.refinement = 0
        self._hands = (Hand(), Hand())
        self._slow_time = self.config.settle_time

    @classmethod
    def from_positions(
        cls, positions_in_table: FloatArray, config: ClothConfig | None = None
    ) -> Cloth:
        """Start at rest from mid-surface positions, shape (V, 3), metres.

        The rest shape is flat; a plastic cloth's is the given one. Vertex (i, j) of the mesh has
        the index i * vertices[1] + j.

        Raises:
            InvalidInputError: If the shape does not fit the config or a value is not finite.
        """
        cloth = cls(config)
        positions = np.array(positions_in_table, dtype=np.float64)
        if positions.shape != cloth._position.shape:
            raise InvalidInputError(
                f"positions must have shape {cloth._position.shape} for a mesh of "
                f"{cloth.config.vertices} vertices, got {positions.shape}"
            )
        if not np.isfinite(positions).all():
            raise InvalidInputError("positions must be finite, got NaN or infinity")
        cloth._position[:] = positions
        cloth._slow_time = 0.0
        cloth._memory.counts[[CLEAN, UNSEEN]] = 0.0, 1.0
        cloth._undo_crossings()
        cloth.take_rest_shape()
        return cloth

    def take_rest_shape(self) -> None:
        """Make a plastic cloth's present lengths and angles those of rest; no other's change."""
        if not self.config.plastic:
            return
        lattice, positions = self._constraints.lattice, self.positions_in_table
        lattice.edge_lengths[:] = pair_lengths(positions, lattice.edges)
        lattice.diagonal_lengths[:] = pair_lengths(positions, lattice.diagonals)
        lattice.hinge_angles[:] = hinge_angles(positions, lattice.hinges)

    def remember(self) -> ClothMoment:
        """Keep the present moment for `go_back`."""
        self._undo_crossings()
        return ClothMoment(
            self._position.copy(),
            self._velocity.copy(),
            tuple(values.copy() for values in self._rest_shape()),
            bool(self._memory.counts[CLEAN]),
        )

    def go_back(self, moment: ClothMoment, refinement: int = 0) -> None:
        """Be as at that moment, with open hands, and go on in shorter substeps.

        Args:
            moment: Of this cloth.
            refinement: How often the number of substeps is multiplied by 1.5 from now on.
        """
        for hand in range(2):
            self.release(hand)
        self._position[:], self._velocity[:] = moment.position, moment.velocity
        self._state.safe[:] = moment.position
        for values, remembered in zip(self._rest_shape(), moment.rest_shape, strict=True):
            values[:] = remembered
        self._renew_memory()
        self._memory.counts[[CLEAN, UNSEEN]] = (1.0, 0.0) if moment.clean else (0.0, 1.0)
        self.refinement = refinement
        self._slow_time = 0.0

    def _rest_shape(self) -> tuple[NDArray[Any], ...]:
        lattice = self._constraints.lattice
        return lattice.edge_lengths, lattice.diagonal_lengths, lattice.hinge_angles

    def _renew_memory(self) -> None:
        counts = self._memory.counts
        self._memory = contact_memory(self.config, self._growth)
        self._memory.counts[[CLEAN, IN_ZONES, UNSEEN]] = counts[[CLEAN, IN_ZONES, UNSEEN]]

    def stop(self) -> None:
        """Take all motion out of the cloth."""
        self._velocity[:] = 0.0

    @property
    def positions_in_table(self) -> FloatArray:
        """Vertices of the mid-surface, shape (V, 3), metres, table frame; a copy."""
        return self._position.astype(np.float64)

    @property
    def top_surface_in_table(self) -> FloatArray:
        """What a camera sees: the mid-surface raised by half the thickness, (V, 3), metres."""
        return self.positions_in_table + np.array([0.0, 0.0, 0.5 * self.config.thickness])

    @property
    def velocities(self) -> FloatArray:
        """Velocities of the vertices, shape (V, 3), m/s; a copy."""
        return self._velocity.astype(np.float64)

    @property
    def max_speed(self) -> float:
        """Speed of the fastest vertex, m/s."""
        return float(np.sqrt((self._velocity**2).sum(axis=1).max()))

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices, shape (T, 3), counter-clockwise seen from the cloth's upper side."""
        return self.mesh.triangles.copy()

    @property
    def thickness(self) -> float:
        """Distance that two layers keep, metres."""
        return self.config.thickness

    @property
    def settled(self) -> bool:
        """Whether nothing has moved noticeably for a while."""
        return self._slow_time >= self.config.settle_time - 1e-9

    def held_count(self, hand: int) -> int:
        """How many vertices a hand holds."""
        return len(self._hand(hand).held)

    def grasp(
        self, hand: int, transform_tool_to_table: FloatArray, jaws: Jaws | None = None
    ) -> int:
        """Close a hand: it takes all layers that are free between its fingers.

        Args:
            hand: 0 or 1; what it held before is released.
            transform_tool_to_table: 4 x 4 tool frame.
            jaws: What the fingers enclose. Without, the hand has none: it takes what is around its
                tool frame's origin, and never loses it.

        Returns:
            How many vertices it holds; 0 if it missed.

        Raises:
            InvalidInputError: If the hand or the transform is not valid.
        """
        transform = check_transform(transform_tool_to_table)
        self.release(hand)
        near = self._around(transform) if jaws is None else self._between(transform, jaws)
        near[self._hands[1 - hand].held] = False
        held = np.flatnonzero(near).astype(np.int32)
        self._hands[hand].close(transform, held, self.positions_in_table, jaws)
        if len(held):
            self._slow_time = 0.0
        return len(held)

    def move_hand(self, hand: int, transform_tool_to_table: FloatArray) -> None:
        """Say where the hand will be at the end of the next `advance`.

        Raises:
            InvalidInputError: If the hand or the transform is not valid.
        """
        self._hand(hand).target = check_transform(transform_tool_to_table)

    def release(self, hand: int) -> None:
        """Open a hand; what it held falls.

        Raises:
            InvalidInputError: If the hand is not 0 or 1.
        """
        if len(self._hand(hand).held):
            self._slow_time = 0.0
        self._hand(hand).open()

    def advance(self, duration: float) -> None:
        """Simulate `duration` seconds, carrying what the hands hold along their motion.

        Costs next to nothing while the cloth rests and no hand holds it.

        Raises:
            InvalidInputError: If the duration is not positive and finite.
        """
        if not math.isfinite(duration) or duration <= 0.0:
            raise InvalidInputError(f"duration must be a positive time, got {duration}")
        holding = any(len(hand.held) for hand in self._hands)
        if holding or not self.settled:
            steps = max(1, math.ceil(duration / self.config.step - 1e-6))
            for step in range(steps):
                self._advance_step(duration / steps, step / steps, (step + 1) / steps)
                for hand in self._hands:
                    if hand.may_lose and hand.lose_slipped(
                        (step + 1) / steps, self.positions_in_table
                    ):
                        self._slow_time = 0.0  # it may have been still while it was held
                self._note_speed(duration / steps)
                if self.settled and not holding:
                    break
        for hand in self._hands:
            hand.current = hand.target

    def check(self, raise_on_failure: bool = False) -> ClothDiagnostics:
        """Examine whether the present state can be believed.

        Crossings that have come up since they were last looked for are undone before.

        Raises:
            SimulationError: If asked to and it cannot.
        """
        self._undo_crossings()
        result = diagnose(
            self.positions_in_table,
            self.mesh,
            self.config,
            self._constraints.lattice.edge_lengths if self.config.plastic else None,
        )
        if raise_on_failure:
            result.raise_on_failure()
        return result

    def _around(self, transform: FloatArray) -> NDArray[np.bool_]:
        """Tell which vertices are near a tool frame's origin."""
        offset = self.positions_in_table - transform[:3, 3]
        near = np.hypot(offset[:, 0], offset[:, 1]) <= self.config.effective_grasp_radius
        return np.asarray(near & (np.abs(offset[:, 2]) <= self.config.grasp_height_tolerance))

    def _between(self, transform: FloatArray, jaws: Jaws) -> NDArray[np.bool_]:
        """Tell which vertices stand for cloth between fingers.

        A vertex stands for the cloth halfway to its neighbours, so that fingers over cloth find
        one however coarse the mesh is, and for the whole thickness.
        """
        places = transform_points(inverse_transform(transform), self.positions_in_table)
        halfway = 0.5 * math.hypot(*self.config.spacing)
        lower, upper = jaws.lower.copy(), jaws.upper.copy()
        lower[:2], upper[:2] = np.minimum(lower[:2], -halfway), np.maximum(upper[:2], halfway)
        lower[2] -= 0.5 * self.config.thickness
        upper[2] += 0.5 * self.config.thickness
        return np.asarray(((places >= lower) & (places <= upper)).all(axis=1))

    def _hand(self, hand: int) -> Hand:
        if hand not in (0, 1):
            raise InvalidInputError(f"a hand must be 0 or 1, got {hand}")
        return self._hands[hand]

    def _note_speed(self, duration: float) -> None:
        fast = (self._velocity**2).sum(axis=1) > self.config.settle_speed**2
        slow = fast.sum() <= MAX_FAST_SHARE * len(fast)
        self._slow_time = self._slow_time + duration if slow else 0.0
        if self.settled and not any(len(hand.held) for hand in self._hands):
            self._undo_crossings()
            self._velocity[:] = 0.0

    def _undo_crossings(self) -> None:
        if self._memory.counts[UNSEEN] > 0.0:
            substeps = self.config.mesh_substeps
            settings = step_settings(self.config, self.config.step / substeps, substeps)
            undo(self._state, self._constraints, self._memory, settings)

    def _advance_step(self, duration: float, start: float, end: float) -> None:
        substeps = math.ceil(self.config.mesh_substeps * REFINEMENT**self.refinement)
        substep = duration / substeps
        held = self._held(start, end, substep)
        if self.config.rigid_grip:
            self._constraints.lattice.mobility[:] = 1.0
            self._constraints.lattice.mobility[held.vertices] = 0.0
        settings = step_settings(self.config, substep, substeps)
        first = 0
        while True:
            first = advance_step(
                self._state, self._constraints, held, self._memory, settings, first
            )
            if first == settings.substeps:
                return
            self._growth *= 2
            self._renew_memory()

    def _held(self, start: float, end: float, substep: float) -> Held:
        reach = [
            np.tile(self._reach(len(hand.held), substep), (len(hand.held), 1))
            for hand in self._hands
        ]
        return Held(
            np.concatenate([hand.held for hand in self._hands]),
            _joined([hand.held_positions(start) for hand in self._hands]),
            _joined([hand.held_positions(end) for hand in self._hands]),
            _joined(reach),
        )

    def _reach(self, held: int, substep: float) -> FloatArray:
        """Ways that a vertex's share of grip and press force moves it in one substep, metres."""
        if self.config.rigid_grip:
            return np.full(2, UNBOUNDED)
        force = np.array([self.config.grip_force, self.config.press_force]) / max(held, 1)
        reach = force / self.config.vertex_mass * substep**2
        # What has slipped catches up no faster than anything else moves.
        return np.asarray(np.minimum(reach, self.config.max_speed * substep))


def _joined(parts: list[FloatArray]) -> NDArray[np.float32]:
    return np.concatenate(parts).astype(np.float32)
