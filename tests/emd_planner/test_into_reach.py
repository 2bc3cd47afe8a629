"""Plans moved into the arms' reach."""

from __future__ import annotations

import pytest
import torch

from emd_core.frames import FieldOfView
from emd_planner.config import ReachConfig
from emd_planner.into_reach import into_reach
from emd_planner.reach import ReachLoss

FOV = FieldOfView()


def _reach(may_cross: bool = True) -> ReachLoss:
    """Left arm: -0.6 < y < 0.1; right arm: -0.1 < y < 0.6; both |x| < 0.5, normalised."""
    side, far, near = (value * FOV.half_extent for value in (0.5, 0.6, 0.1))
    return ReachLoss(
        ReachConfig(
            left=((-side, -far), (side, -far), (side, near), (-side, near)),
            right=((-side, -near), (side, -near), (side, far), (-side, far)),
        ),
        FOV,
        torch.device("cpu"),
        may_cross,
    )


@pytest.mark.parametrize("may_cross", [True, False])
def test_what_is_planned_anywhere_ends_within_reach(may_cross):
    """Of 500 random manipulations none is left outside; those within reach stay as they are."""
    reach, generator = _reach(may_cross), torch.Generator().manual_seed(0)
    for _ in range(500):
        planned = 2.4 * torch.rand(6, generator=generator) - 1.2
        used = torch.rand(2, generator=generator) < 0.7
        moved = into_reach(planned, used, reach)
        assert reach(moved, used) == 0.0
        if reach(planned, used) == 0.0:
            assert moved is planned
        unused = (~used).repeat_interleave(2)
        assert torch.equal(moved[:4][unused], planned[:4][unused])
        assert not used.any() or reach(planned, used) == 0.0 or not torch.equal(moved, planned)


def test_a_release_out_of_reach_is_moved_to_the_border():
    """The grasp stays, and the displacement loses what is too much of it."""
    planned = torch.tensor([0.2, -0.2, 0.9, 0.9, 0.8, 0.1])
    moved = into_reach(planned, torch.tensor([True, False]), _reach())
    torch.testing.assert_close(moved[:4], planned[:4])
    torch.testing.assert_close(moved[4:], torch.tensor([0.3, 0.1]), atol=2e-3, rtol=0.0)


def test_two_hands_keep_one_displacement():
    """It ends where both releases are within reach."""
    planned = torch.tensor([0.4, -0.4, -0.4, 0.4, 0.6, 0.4])
    moved = into_reach(planned, torch.tensor([True, True]), _reach())
    torch.testing.assert_close(moved[:4], planned[:4])
    torch.testing.assert_close(moved[4:], torch.tensor([0.1, 0.2]), atol=3e-3, rtol=0.0)


def test_a_grasp_out_of_reach_goes_to_cloth_within_reach():
    """To its nearest column that the arm reaches, if there is cloth in reach at all."""
    planned, used = torch.tensor([0.9, -0.2, 0.0, 0.0, -0.2, 0.0]), torch.tensor([True, False])
    cloth = torch.zeros(32, 32, dtype=torch.bool)
    cloth[18:, 12:14] = True  # from x = 0.125 to beyond the reach, y from -0.25 to -0.125
    moved = into_reach(planned, used, _reach(), cloth)
    torch.testing.assert_close(moved[:2], torch.tensor([0.469, -0.2]), atol=0.035, rtol=0.0)
    column = ((moved[:2] + 1.0) * 16.0).long()
    assert cloth[column[0], column[1]]
    far = torch.zeros(32, 32, dtype=torch.bool)
    far[30, 12] = True
    assert _reach()(into_reach(planned, used, _reach(), far), used) == 0.0
