"""How well a net predicts held-out sequences, beside predictions that need no net."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from emd_planner.dataset import SequenceSet, Windows
from emd_planner.losses import consistency_loss, state_loss
from emd_planner.state_predictor import StatePredictor
from emd_planner.unused_hands import fill_unused


@dataclass(frozen=True)
class Scores:
    """Mean squared errors per voxel over windows of n steps (loss_s; paper, V-A).

    Attributes:
        net: Of the net's real-valued prediction.
        consistency: Its loss_c.
        do_nothing: Of the initial state.
        empty: Of a grid without cloth.
        mean: Of the mean grid of the training states, the best constant prediction.
    """

    net: float
    consistency: float
    do_nothing: float
    empty: float
    mean: float


class Validator:
    """Scores nets on fixed windows of held-out sequences, the same at every call."""

    def __init__(
        self,
        held_out: SequenceSet,
        mean_grid: Tensor,
        steps: int,
        device: torch.device,
        most: int = 384,
        seed: int = 0,
    ) -> None:
        """Choose at most `most` windows of `steps` manipulations and fill their unused points."""
        starts = held_out.window_starts(steps)
        if len(starts) > most:
            starts = np.sort(np.random.default_rng(seed).choice(starts, most, replace=False))
        windows = held_out.windows(starts, steps)
        generator = torch.Generator().manual_seed(seed)
        filled = fill_unused(windows.grids[:, :-1], windows.manipulations, generator)
        self.steps = steps
        self._windows = Windows(windows.grids, filled)
        self._mean_grid = mean_grid
        self._device = device

    def __len__(self) -> int:
        """Count the windows."""
        return len(self._windows.grids)

    @torch.no_grad()
    def scores(self, net: StatePredictor, batch_size: int = 64) -> Scores:
        """Predict the last state of each window from its first and compare."""
        rows = []
        for start in range(0, len(self), batch_size):
            grids = self._windows.grids[start : start + batch_size].to(self._device)
            manipulations = self._windows.manipulations[start : start + batch_size]
            last = grids[:, -1].float()
            code = net.roll_out(net.encode(grids[:, 0]), manipulations.to(self._device))[-1]
            rows.append(
                torch.stack(
                    [
                        state_loss(net.decode(code), last),
                        consistency_loss(code, net.encode(grids[:, -1])),
                        state_loss(grids[:, 0].float(), last),
                        state_loss(torch.zeros_like(last), last),
                        state_loss(self._mean_grid.to(self._device)[None], last),
                    ]
                )
            )
        return Scores(*torch.cat(rows, dim=1).mean(1).tolist())


def mean_grid(sequences: SequenceSet, most: int = 2000) -> Tensor:
    """Average the states of a set (the first `most` of them), shape (X, Y, Z), float32."""
    bits = np.unpackbits(
        sequences.packed_grids[:most], axis=1, count=int(np.prod(sequences.grid_size))
    )
    return torch.from_numpy(bits.mean(0, dtype=np.float32)).view(sequences.grid_size)
