"""Perform manipulations on a simulated cloth without a robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import HandPathConfig
from emd_cloth_sim.diagnostics import ClothDiagnostics
from emd_cloth_sim.hand_path import HandPath, arc_path
from emd_cloth_sim.reference_path import ReferencePathConfig, reference_offsets
from emd_core.frames import FloatArray
from emd_core.independent_manipulation import HandsManipulation

# Simulations of a manipulation until its outcome can be believed.
ATTEMPTS = 4
# Greatest speed of the reference's hands at one attempt over that at the one before.
SLOWER = 0.5


@dataclass(frozen=True)
class ManipulationOutcome:
    """What became of a manipulation.

    Attributes:
        held_counts: Vertices that each hand held; 0 if it missed or was not used.
        carry_time: Seconds from the grasp to the release; 0 if nothing was held.
        settle_time: Seconds from the release until the cloth rested or the limit was reached.
        settled: Whether it came to rest within the limit.
        diagnostics: Whether the final state can be believed.
        attempts: How often it was simulated: again from the start, in shorter substeps, as long as
            the outcome could not be believed, `ATTEMPTS` times at most.
    """

    held_counts: tuple[int, int]
    carry_time: float
    settle_time: float
    settled: bool
    diagnostics: ClothDiagnostics
    attempts: int = 1


def manipulate(
    cloth: Cloth,
    manipulation: HandsManipulation,
    path_config: HandPathConfig | ReferencePathConfig | None = None,
) -> ManipulationOutcome:
    """Grasp all layers at the used points, carry them along an arc, release, let settle.

    A grasp point beside the cloth holds nothing; if no hand holds anything, nothing happens. The
    reference's path starts from a cloth without motion whose shape is that of rest, and ends when
    its time is over, whether the cloth has settled or not.

    If the outcome cannot be believed (crumpled cloth may lock under tension), the manipulation is
    simulated again from its start in shorter substeps, and the reference's hands, which may jump
    through a pile, take more time. One that starts with crossings is not: no substep mends these.
    """
    config = path_config or HandPathConfig()
    before = cloth.remember()
    for attempt in range(ATTEMPTS):
        if attempt > 0:
            cloth.go_back(before, attempt)
        if isinstance(config, ReferencePathConfig):
            slower = replace(config, hand_speed=config.hand_speed * SLOWER**attempt)
            outcome = _manipulate_as_reference(cloth, manipulation, slower)
        else:
            outcome = _manipulate_by_hand(cloth, manipulation, config)
        if not outcome.diagnostics.failure or not before.clean:
            break
    cloth.refinement = 0
    return replace(outcome, attempts=attempt + 1)


def _manipulate_by_hand(
    cloth: Cloth,
    manipulation: HandsManipulation,
    config: HandPathConfig,
) -> ManipulationOutcome:
    paths = {}
    for hand in range(2):
        if manipulation.used[hand]:
            point = manipulation.grasp_points_in_table[hand]
            displacement = manipulation.displacements_in_table[hand]
            paths[hand] = _grasp_and_plan(cloth, hand, point, displacement, config)
    held = (cloth.held_count(0), cloth.held_count(1))
    carry_time = 0.0
    if any(held):
        carry_time = _carry(cloth, {hand: path for hand, path in paths.items() if held[hand]})
    for hand in paths:
        cloth.release(hand)
    settle_time = settle(cloth, config.settle_time_limit) if any(held) else 0.0
    return ManipulationOutcome(held, carry_time, settle_time, cloth.settled, cloth.check())


def _manipulate_as_reference(
    cloth: Cloth,
    manipulation: HandsManipulation,
    config: ReferencePathConfig,
) -> ManipulationOutcome:
    cloth.stop()
    cloth.take_rest_shape()
    starts, offsets = {}, {}
    for hand in range(2):
        if manipulation.used[hand]:
            starts[hand] = np.array([*manipulation.grasp_points_in_table[hand], 0.0])
            offsets[hand] = reference_offsets(manipulation.displacements_in_table[hand], config)
            cloth.grasp(hand, _tool_frame(starts[hand]))
    held = (cloth.held_count(0), cloth.held_count(1))
    if not any(held):
        return ManipulationOutcome(held, 0.0, 0.0, cloth.settled, cloth.check())
    carry_time = 0.0
    for frame in range(max(len(path) for path in offsets.values())):
        ways = [_way(path, frame) for path in offsets.values()]
        duration = max(config.frame, max(ways) / config.hand_speed)
        for hand, path in offsets.items():
            # A hand with a shorter way waits at its end for the other.
            offset = path[min(frame, len(path) - 1)]
            cloth.move_hand(hand, _tool_frame(starts[hand] + offset))
        cloth.advance(duration)
        carry_time += duration
    for hand in starts:
        cloth.release(hand)
    for _ in range(config.frames_after):
        cloth.advance(config.frame)
    frames = config.frames_after
    while (diagnostics := cloth.check()).stretched and frames < (
        config.frames_after + config.frames_more
    ):
        cloth.advance(config.frame)
        frames += 1
    return ManipulationOutcome(held, carry_time, frames * config.frame, cloth.settled, diagnostics)


def _way(path: FloatArray, frame: int) -> float:
    """How far a hand goes in a frame of its path (F, 3), which begins at the grasp, metres."""
    if frame >= len(path):
        return 0.0
    before = path[frame - 1] if frame > 0 else np.zeros(3)
    return float(np.linalg.norm(path[frame] - before))


def settle(cloth: Cloth, time_limit: float) -> float:
    """Wait until the cloth rests, at most `time_limit` seconds; returns how long it took."""
    time = 0.0
    while not cloth.settled and time < time_limit:
        cloth.advance(cloth.config.step)
        time += cloth.config.step
    return time


def pile_height(cloth: Cloth, point_in_table: FloatArray, free: FloatArray) -> float:
    """Mid-surface height of the highest vertex of `free` around a point (2,), metres.

    Height of the first layer's mid-surface below the desk if there is none, so that a layer laid
    on top of it touches the desk.
    """
    radius = 1.5 * cloth.config.effective_grasp_radius
    near = np.hypot(*(free[:, :2] - point_in_table).T) <= radius
    return float(free[near, 2].max()) if near.any() else -0.5 * cloth.thickness


def _grasp_and_plan(
    cloth: Cloth, hand: int, point: FloatArray, displacement: FloatArray, config: HandPathConfig
) -> HandPath:
    positions = cloth.positions_in_table
    near = np.hypot(*(positions[:, :2] - point).T) <= cloth.config.effective_grasp_radius
    heights = positions[near, 2] if near.any() else np.array([0.5 * cloth.thickness])
    start = np.array([*point, 0.5 * (heights.min() + heights.max())])
    cloth.grasp(hand, _tool_frame(start))
    target = pile_height(cloth, point + displacement, positions[~near])
    lowest = start[2] - heights.min()
    end_height = target + cloth.thickness + lowest + config.release_clearance
    return arc_path(start, displacement, end_height, config)


def _carry(cloth: Cloth, paths: dict[int, HandPath]) -> float:
    duration = max(path.duration for path in paths.values())
    steps = int(np.ceil(duration / cloth.config.step))
    for step in range(1, steps + 1):
        for hand, path in paths.items():
            cloth.move_hand(hand, _tool_frame(path.position_in_table(step * cloth.config.step)))
        cloth.advance(cloth.config.step)
    return steps * cloth.config.step


def _tool_frame(position: FloatArray) -> FloatArray:
    """A hand that points straight down (z of the tool frame is the approach direction)."""
    transform = np.diag([1.0, -1.0, -1.0, 1.0])
    transform[:3, 3] = position
    return transform
