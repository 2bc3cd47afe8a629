"""The losses (paper, eq. 1 and 2)."""

from __future__ import annotations

import numpy as np
import torch

from emd_core.metrics import voxel_mse
from emd_planner.losses import consistency_loss, state_loss


def test_state_loss_of_binary_grids_is_the_voxel_mse(rectangle, grid_of):
    """On binary grids loss_s is the share of differing voxels, as the metrics count it."""
    one, other = grid_of(rectangle()), grid_of(rectangle((0.3, 0.1)))
    loss = state_loss(
        torch.from_numpy(one.occupancy)[None].float(),
        torch.from_numpy(other.occupancy)[None].float(),
    )
    np.testing.assert_allclose(loss.numpy(), [voxel_mse(one, other)], rtol=1e-6)


def test_losses_are_sums_of_squares_over_the_number_of_values():
    """Eq. 1 divides by the 16384 voxels, eq. 2 by the 512 values of a code."""
    predicted, actual = torch.zeros(2, 32, 32, 16), torch.zeros(2, 32, 32, 16)
    predicted[1, 3, 4, 5] = 2.0
    torch.testing.assert_close(state_loss(predicted, actual), torch.tensor([0.0, 4.0 / 16384]))
    codes = torch.zeros(2, 512)
    codes[0, 7] = 3.0
    torch.testing.assert_close(
        consistency_loss(codes, torch.zeros(2, 512)), torch.tensor([9.0 / 512, 0.0])
    )
