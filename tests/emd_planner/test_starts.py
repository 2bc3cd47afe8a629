"""Where searches begin."""

from __future__ import annotations

import pytest
import torch

from emd_planner.config import SpatialNetConfig
from emd_planner.cost import grasps_cloth
from emd_planner.emd_net import EmdNet
from emd_planner.spatial_net import SpatialEmdNet
from emd_planner.starts import guessed_values, random_values

CPU = torch.device("cpu")


@pytest.fixture
def patch(rectangle, grid_of):
    """A flat patch in the middle, boolean (X, Y, Z)."""
    return torch.from_numpy(grid_of(rectangle((0.0, 0.0), (0.8, 0.5))).occupancy)


def test_single_handed_starts_leave_the_second_hand_off_the_cloth(patch):
    """The share that was asked for; the first hand is on the cloth in any case."""
    values = random_values(
        500, 2, patch.any(-1), torch.Generator().manual_seed(0), CPU, single_handed_share=0.5
    )
    used = grasps_cloth(values, patch.expand(500, 2, -1, -1, -1), 0)
    assert used[..., 0].all()
    assert used[..., 1].float().mean() == pytest.approx(0.5, abs=0.05)


def test_guesses_are_rolled_out_and_depend_on_the_seed(patch):
    """As many sequences as asked for; a net without guesses gives none."""
    net = SpatialEmdNet(SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1))
    first, same, other = (
        guessed_values(net, patch, patch, 3, 20, torch.Generator().manual_seed(s))
        for s in (0, 0, 1)
    )
    assert first.shape == (20, 3, 6)
    assert torch.equal(first, same)
    assert not torch.equal(first, other)
    assert guessed_values(EmdNet(), patch, patch, 3, 20, torch.Generator()) is None
