"""Cloth sequences as tensors on the device that trains, and windows read from them there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Windows:
    """Runs of successive states and the manipulations between them.

    Attributes:
        grids: Boolean, shape (B, n+1, X, Y, Z).
        manipulations: x0 y0 x1 y1 dx dy, shape (B, n, 6), float32, normalised; a NaN point: hand
            not used; both points and the displacement NaN: nothing was done and nothing changed.
        points: Normalised points of the cloth that the grids were made of, shape
            (B, n+1, V, 3), float32; NaN in windows whose points are unknown; None if all are.
    """

    grids: Tensor
    manipulations: Tensor
    points: Tensor | None = None


@dataclass(frozen=True)
class SequenceTensors:
    """All states of some sequences in order, on one device.

    Attributes:
        packed_grids: Shape (S, voxels / 8), uint8, as `numpy.packbits` packs them.
        manipulations: Shape (S, 6), float32: the one that follows each state; NaN after the last.
        last_states: For each state the index of the last one of its sequence, shape (S,).
        grid_size: Voxels along x, y and z.
        points: Shape (S, V, 3), float16, normalised; NaN where they are unknown; None if all are.
    """

    packed_grids: Tensor
    manipulations: Tensor
    last_states: Tensor
    grid_size: tuple[int, int, int]
    points: Tensor | None = None

    def to(self, device: torch.device) -> SequenceTensors:
        """Move them to a device."""
        points = None if self.points is None else self.points.to(device)
        parts = (self.packed_grids, self.manipulations, self.last_states)
        packed, manipulations, last = (part.to(device) for part in parts)
        return SequenceTensors(packed, manipulations, last, self.grid_size, points)

    def windows(self, starts: Tensor, steps: int) -> Windows:
        """Read windows; one that passes the end of its sequence stays at the last state.

        Args:
            starts: States at which the windows begin, shape (B,), on the same device.
            steps: Manipulations in a window.
        """
        ahead = torch.arange(steps + 1, device=starts.device)
        states = torch.minimum(starts[:, None] + ahead, self.last_states[starts][:, None])
        places = torch.arange(7, -1, -1, dtype=torch.uint8, device=starts.device)
        bits = (self.packed_grids[states][..., None] >> places & 1).bool().flatten(-2)
        grids = bits[..., : math.prod(self.grid_size)].unflatten(-1, self.grid_size)
        points = None if self.points is None else self.points[states].float()
        return Windows(grids, self.manipulations[states[:, :-1]], points)
