"""Random changes to training examples that keep them true (paper, III-B), on whole batches.

Grids have axes (..., X, Y, Z) of the table frame, so quarter turns, mirrorings and shifts by whole
voxels move columns and leave their contents alone: they are exact. Other angles and shifts are
done on the points of the cloth, which are then rasterised anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_planner.rasterise import rasterise
from emd_planner.sequence_tensors import Windows
from emd_planner.training_config import AugmentationConfig
from emd_planner.unused_hands import fill_unused, miss_narrowly

# Quarter turns about z and their products with the mirroring of y.
SYMMETRIES = torch.tensor(
    [
        [[1, 0], [0, 1]],
        [[0, -1], [1, 0]],
        [[-1, 0], [0, -1]],
        [[0, 1], [-1, 0]],
        [[1, 0], [0, -1]],
        [[0, 1], [1, 0]],
        [[-1, 0], [0, 1]],
        [[0, -1], [-1, 0]],
    ]
)


@dataclass(frozen=True)
class Examples:
    """What a net is trained on.

    Attributes:
        grids: Boolean, shape (B, n+1, X, Y, Z).
        manipulations: Shape (B, n, 6), without NaN.
        used: Whether each hand grasped cloth, boolean, shape (B, n, 2).
    """

    grids: Tensor
    manipulations: Tensor
    used: Tensor


def augment(
    windows: Windows, config: AugmentationConfig, generator: torch.Generator, height: float = 0.25
) -> Examples:
    """Apply all configured changes and fill the unused points.

    Examples whose points are unknown are neither turned freely nor given near misses.

    Args:
        windows: Examples, with the points of the cloth if some are to be turned freely.
        config: Which changes.
        generator: On the device of the windows.
        height: Of the field of view, normalised.

    Raises:
        InvalidInputError: If free turns or near misses are configured and no points are known.
    """
    grids, points = windows.grids, windows.points
    if points is None and max(config.free_share, config.near_miss_share) > 0.0:
        raise InvalidInputError(
            "turning the cloth freely and near misses need data with `states`, and none of these "
            "have them; give data with vertices, or set free_share and near_miss_share to 0"
        )
    delays = [spread_idle_steps(windows.manipulations, generator)]
    delays.append(failing_steps(windows.manipulations, config.failure_probability, generator))
    manipulations = windows.manipulations
    states = torch.arange(grids.shape[1], device=grids.device).expand(grids.shape[:2])
    for position in delays:
        states, manipulations = delay(states, manipulations, position)
    rows = torch.arange(len(grids), device=grids.device)[:, None]
    grids = grids[rows, states]
    used = ~manipulations[..., [0, 2]].isnan()
    if points is not None:
        points = points[rows, states]
        if config.near_miss_share > 0.0:
            manipulations = miss_narrowly(grids, points, manipulations, config, generator)
    symmetries, shifts = _random_motions(len(grids), grids.shape[2], config, generator)
    grids, changed = transform(grids, manipulations, symmetries, shifts)
    free = round(config.free_share * len(grids))  # the windows of a batch are in random order
    if points is not None and free:
        known = points[:free, 0, 0, 0].isfinite()
        turned, rasterised = _turn_freely(
            manipulations[:free], points[:free], grids.shape[2:], height, config, generator
        )
        changed[:free] = torch.where(known[:, None, None], turned, changed[:free])
        known = known.view(-1, 1, 1, 1, 1)
        grids[:free] = torch.where(known, rasterised, grids[:free])
    manipulations = fill_unused(grids[:, :-1], changed, generator, config.outside_margin_voxels)
    if config.swap_grasps:
        swap = _random(generator, *manipulations.shape[:2]) < 0.5
        manipulations = torch.where(
            swap[..., None], manipulations[..., [2, 3, 0, 1, 4, 5]], manipulations
        )
        used = torch.where(swap[..., None], used.flip(-1), used)
    return Examples(grids, manipulations, used)


def transform(
    grids: Tensor, manipulations: Tensor, symmetries: Tensor, shifts: Tensor
) -> tuple[Tensor, Tensor]:
    """Turn or mirror about the middle of the field of view, then shift periodically.

    Args:
        grids: Shape (B, n+1, X, Y, Z) with X = Y.
        manipulations: Shape (B, n, 6).
        symmetries: Orthogonal integer matrices on (x, y), shape (B, 2, 2).
        shifts: Whole voxels along x and y, shape (B, 2), integer.

    Returns:
        Both, in the same shapes; points wrapped into [-1, 1).
    """
    count = grids.shape[2]
    line = torch.arange(count, device=grids.device)
    targets = torch.cartesian_prod(line, line)
    # Twice the distance from the middle is an integer, for odd and even counts.
    doubled = 2 * ((targets[None] - shifts[:, None]) % count) - (count - 1)
    turned = doubled.float() @ symmetries.float()  # rows times A are (A^T p)^T
    sources = (turned.round().long() + (count - 1)) // 2
    flat = sources[..., 0] * count + sources[..., 1]
    columns = grids.flatten(2, 3)
    index = flat[:, None, :, None].expand(columns.shape)
    moved = columns.gather(2, index).view(grids.shape)
    return moved, move_vectors(manipulations, symmetries, (2.0 / count) * shifts)


def failing_steps(manipulations: Tensor, probability: float, generator: torch.Generator) -> Tensor:
    """Choose the step of some windows at which both hands miss the cloth (III-B).

    Windows that have a step without grasp points already are left alone.

    Returns:
        For `delay`: shape (B,), the window's length where nothing fails.
    """
    batch, steps = manipulations.shape[:2]
    failing = _random(generator, batch) < probability
    failing &= ~manipulations[..., :4].isnan().all(-1).any(1)
    position = _random_integers(generator, 0, steps, batch)
    return torch.where(failing, position, steps)


def spread_idle_steps(manipulations: Tensor, generator: torch.Generator) -> Tensor:
    """Choose for each window that passes the end of its sequence where its idle step goes.

    `SequenceSet.windows` fills such a window with steps at which nothing is done, at its end.

    Returns:
        Position of the idle step, shape (B,); the window's length where there is none.
    """
    batch, steps = manipulations.shape[:2]
    position = _random_integers(generator, 0, steps, batch)
    return torch.where(is_idle(manipulations[:, -1]), position, steps)


def is_idle(manipulations: Tensor) -> Tensor:
    """Whether manipulations (..., 6) are fillers at which nothing was done (all NaN)."""
    return manipulations.isnan().all(-1)


def delay(states: Tensor, manipulations: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
    """Insert a step at which the hands grasp nothing: its outcome is a copy of its initial state.

    The displacement of the step that would have been there stays, its points become unused, and
    what follows moves one step later (the last step drops out), so that a window of several steps
    stays true. For windows of one step this is the paper's failure to grasp (III-B).

    Args:
        states: Shape (B, n+1, ...): grids, points or indices of states.
        manipulations: Shape (B, n, 6).
        position: Of the new step, shape (B,); n changes nothing.
    """
    steps = manipulations.shape[1]
    state = torch.arange(steps + 1, device=states.device)[None]
    state = torch.where(state > position[:, None], state - 1, state)
    step = torch.arange(steps, device=states.device)[None]
    source = torch.where(step > position[:, None], step - 1, step)
    rows = torch.arange(len(states), device=states.device)[:, None]
    delayed = manipulations[rows, source]
    fails = step == position[:, None]
    delayed[..., :4] = torch.where(fails[..., None], torch.nan, delayed[..., :4])
    return states[rows, state], delayed


def move_vectors(manipulations: Tensor, matrices: Tensor, offsets: Tensor) -> Tensor:
    """Turn points and displacements by matrices (B, 2, 2) and shift points by offsets (B, 2).

    Points are wrapped into [-1, 1).
    """
    vectors = manipulations.unflatten(2, (3, 2)) @ matrices.mT[:, None].to(manipulations.dtype)
    vectors[:, :, :2] += offsets[:, None, None]
    vectors[:, :, :2] = (vectors[:, :, :2] + 1.0) % 2.0 - 1.0
    return vectors.flatten(2)


def _turn_freely(
    manipulations: Tensor,
    points: Tensor,
    size: torch.Size,
    height: float,
    config: AugmentationConfig,
    generator: torch.Generator,
) -> tuple[Tensor, Tensor]:
    """Turn points and hands by any angle, mirror, shift by any length, and rasterise anew."""
    batch = len(points)
    angles = 2.0 * torch.pi * _random(generator, batch)
    cosines, sines = angles.cos(), angles.sin()
    signs = 1.0 - 2.0 * _random_integers(generator, 0, 2, batch) * config.mirror
    matrices = torch.stack([cosines, -sines * signs, sines, cosines * signs], 1).view(-1, 2, 2)
    offsets = config.free_shift * (2.0 * _random(generator, batch, 2) - 1.0)
    xy = points[..., :2] @ matrices.mT[:, None] + offsets[:, None, None]
    moved = torch.cat([xy, points[..., 2:]], dim=-1).nan_to_num()
    grids = rasterise(moved.flatten(0, 1), (size[0], size[1], size[2]), height)
    return move_vectors(manipulations, matrices, offsets), grids.unflatten(0, points.shape[:2])


def _random_motions(
    batch: int, count: int, config: AugmentationConfig, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    turns = _random_integers(generator, 0, 4, batch) * config.rotate
    mirrored = _random_integers(generator, 0, 2, batch) * config.mirror
    reach = min(config.translation_voxels, count)
    shifts = _random_integers(generator, -reach, reach + 1, batch, 2)
    return SYMMETRIES.to(turns.device)[turns + 4 * mirrored], shifts


def _random(generator: torch.Generator, *shape: int) -> Tensor:
    """Draw from [0, 1), on the generator's device."""
    return torch.rand(shape, generator=generator, device=generator.device)


def _random_integers(generator: torch.Generator, low: int, end: int, *shape: int) -> Tensor:
    """Draw integers from low to before end, on the generator's device."""
    return torch.randint(low, end, shape, generator=generator, device=generator.device)
