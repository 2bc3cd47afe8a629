"""Where searches begin."""

from __future__ import annotations

import pytest
import torch

from emd_planner.cost import grasps_cloth
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import SpatialNetConfig
from emd_planner.silhouette import dilate, outside_cloth
from emd_planner.spatial_net import SpatialEmdNet
from emd_planner.starts import guessed_sequences, random_values, without_doubtful_hand

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
    """As many sequences as asked for, with what the net predicts of them; some nets give none."""
    net = SpatialEmdNet(SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1))
    limits = torch.tensor([1.0, 1.0, 1.0, 1.0, 0.1, 0.1])
    first, same, other = (
        guessed_sequences(net, patch, patch, 3, 20, torch.Generator().manual_seed(s), limits)
        for s in (0, 0, 1)
    )
    assert first.values.shape == (20, 3, 6)
    assert (first.values.abs() <= limits).all()
    assert torch.equal(first.values, same.values)
    assert not torch.equal(first.values, other.values)
    expected = net.predict_all(patch.expand(20, -1, -1, -1), first.values)
    torch.testing.assert_close(first.states, expected, atol=1e-5, rtol=0.0)
    assert guessed_sequences(EmdNet(), patch, patch, 3, 20, torch.Generator(), limits) is None


def test_a_hand_just_beside_the_cloth_is_also_taken_away():
    """One variant for each doubtful hand whose partner grasps; none where hands are plain."""
    silhouette = torch.zeros(32, 32, dtype=torch.bool)
    silhouette[8:24, 8:24] = True
    sure, beside, far = (-0.2, 0.1), (0.56, 0.0), (0.9, 0.9)

    def variants(first, second):
        values = torch.tensor([[*first, *second, 0.3, 0.0], [0.0, 0.0, 0.1, 0.1, 0.2, 0.2]])
        found = without_doubtful_hand(values, silhouette, 2)
        assert all(torch.equal(one[1:], values[1:]) for one in found)
        return values, found

    values, (single,) = variants(sure, beside)
    assert torch.equal(single[0, [0, 1, 4, 5]], values[0, [0, 1, 4, 5]])
    assert outside_cloth(single[:1, 2:4], dilate(silhouette[None], 2)).all()
    assert len(variants(beside, beside)[1]) == 2
    for hands in ((sure, sure), (sure, far), (beside, far), (far, beside)):
        assert variants(*hands)[1] == []
