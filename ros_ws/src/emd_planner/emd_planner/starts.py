"""Where searches begin: at random (paper, III-C, step 2), or at what the net guesses (ours)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from emd_planner.silhouette import near_cloth, silhouettes
from emd_planner.state_predictor import StatePredictor
from emd_planner.unused_hands import random_points_outside


def random_values(
    restarts: int,
    steps: int,
    silhouette: Tensor | None,
    generator: torch.Generator,
    device: torch.device,
    max_displacement: float = 1.0,
    single_handed_share: float = 0.0,
) -> Tensor:
    """Draw starts for `search` (III-C, step 2).

    Args:
        restarts: Number of starts.
        steps: Manipulations in each.
        silhouette: Boolean (X, Y): grasp points start uniformly on these columns; None: anywhere
            in [-1, 1]. Where the cloth lies in later steps is not known; its first place is used.
        generator: On the CPU.
        device: Of the result.
        max_displacement: Largest magnitude of a displacement's x and y.
        single_handed_share: Share of the steps in which the second hand starts anywhere off the
            silhouette, where there is room.

    Returns:
        Shape (restarts, steps, 6): points x0 y0 x1 y1, then a displacement.
    """
    values = 2.0 * torch.rand((restarts, steps, 6), generator=generator) - 1.0
    columns = torch.nonzero(silhouette.cpu()) if silhouette is not None else torch.zeros(0, 2)
    if silhouette is not None and len(columns):
        choice = torch.randint(len(columns), (restarts, steps, 2), generator=generator)
        inside = torch.rand((restarts, steps, 2, 2), generator=generator)
        size = torch.tensor(silhouette.shape)
        points = (columns[choice] + inside) / size * 2.0 - 1.0
        values[..., :4] = points.flatten(2)
        if single_handed_share > 0.0:
            idle = torch.rand((restarts, steps, 1), generator=generator) < single_handed_share
            off = random_points_outside(
                silhouette.cpu().expand(restarts, steps, -1, -1), generator
            )
            values[..., 2:4] = torch.where(idle, off[..., 1, :], values[..., 2:4])
    values[..., 4:] *= max_displacement
    return values.to(device)


def without_doubtful_hand(
    values: Tensor, silhouette: Tensor, tolerance_voxels: int
) -> list[Tensor]:
    """Take a hand off the cloth whose first grasp lies just beside it.

    The search may have meant such a hand to miss, and not to be moved onto the cloth.

    Args:
        values: One sequence, shape (n, 6).
        silhouette: Of the initial state, boolean (X, Y).
        tolerance_voxels: How far beside the cloth a point counts as grasping.

    Returns:
        The sequence without it, for each such hand that is not the only one.
    """
    points = values[0, :4].view(2, 2)
    grasps = near_cloth(points, silhouette, tolerance_voxels)
    doubtful = grasps & ~near_cloth(points, silhouette, 0)
    generator = torch.Generator().manual_seed(0)  # any place will do
    away = random_points_outside(silhouette.cpu(), generator, tolerance_voxels + 1).to(values)
    found = []
    for hand in range(2):
        if doubtful[hand] and grasps[1 - hand]:
            single = values.clone()
            single[0, 2 * hand : 2 * hand + 2] = away[hand]
            found.append(single)
    return found


@dataclass(frozen=True)
class GuessedSequences:
    """Sequences of manipulations and what the net predicts of them.

    Attributes:
        values: Shape (N, steps, 6), within the limits.
        states: After each manipulation, shape (N, steps, X, Y, Z).
    """

    values: Tensor
    states: Tensor


@torch.no_grad()
def guessed_sequences(
    net: StatePredictor,
    initial: Tensor,
    goal: Tensor,
    steps: int,
    count: int,
    generator: torch.Generator,
    limits: Tensor,
    threshold: float = 0.5,
    first: Tensor | None = None,
) -> GuessedSequences | None:
    """Draw whole sequences from the net's guesses, each step from the state predicted before it.

    Args:
        net: Guesses and predicts.
        initial: Boolean, shape (X, Y, Z).
        goal: The same.
        steps: Manipulations in each sequence.
        count: Number of sequences.
        generator: On the CPU.
        limits: Largest magnitude of each value of a manipulation, shape (6,).
        threshold: Predicted value from which a voxel counts as occupied.
        first: First manipulations of further sequences, shape (F, 6), a NaN point: not used.

    Returns:
        `count` sequences and those that go on after `first`; None for a net without guesses. A
        hand that is not used is put at a random place outside the cloth.
    """
    given = initial.new_zeros((0, 6), dtype=torch.float32) if first is None else first
    codes, goal_code = net.encode(torch.stack([initial, goal])).split(1)
    state = initial.expand(count + len(given), *initial.shape)
    drawn, predicted = [], []
    for step in range(steps):
        left = torch.full((len(codes),), steps - step, device=codes.device)
        guesses = net.propose(codes, goal_code.expand_as(codes), left)
        if guesses is None:
            return None
        if step == 0:  # one state, many draws
            guesses, codes = guesses.expand(count), codes.expand(len(state), *codes.shape[1:])
        values, both = guesses.draw(generator)
        if step == 0:
            values = torch.cat([values, given.to(values)])
            both = torch.cat([both, given[:, 2].isfinite().to(both)])
        outside = random_points_outside(silhouettes(state).cpu(), generator)[:, 1].to(values)
        values[:, 2:4] = torch.where(both[:, None], values[:, 2:4], outside)
        drawn.append(values.clamp(-limits, limits))
        codes = net.manipulate(codes, drawn[-1])
        predicted.append(net.decode(codes))
        state = predicted[-1] >= threshold
    return GuessedSequences(torch.stack(drawn, 1), torch.stack(predicted, 1))
