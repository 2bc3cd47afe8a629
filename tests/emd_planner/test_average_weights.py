"""Claims about averaging a net with what it became."""

import dataclasses

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.average_weights import average_weights
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.spatial_net import SpatialEmdNet
from emd_planner.weights import load_net, read_provenance, save_net

SMALL = SpatialNetConfig(
    grid_size=(16, 16, 4), widths=(8, 8, 8), moved_width=4, proposals=2, proposal_widths=(8, 8, 8)
)


@pytest.fixture
def nets(tmp_path):
    """Files of two nets that differ in every weight."""
    paths = [tmp_path / f"{name}.safetensors" for name in ("before", "after")]
    for seed, path in enumerate(paths):
        net = SpatialEmdNet(SMALL, seed)
        with torch.no_grad():
            for weight in net.parameters():
                weight.add_(0.1 + seed)
        save_net(net, path, {"seed": seed}, net.state_dict())
    return paths


def test_weights_lie_between_those_of_the_two_nets(nets, tmp_path):
    """At a share of a quarter, every weight is a quarter of the way from the first net's."""
    out = tmp_path / "average.safetensors"
    assert average_weights(*nets, 0.25, out) == []
    before, after, found = (load_net(path).state_dict() for path in (*nets, out))
    for name, weight in found.items():
        wanted = 0.75 * before[name] + 0.25 * after[name]
        torch.testing.assert_close(weight, wanted, atol=2e-3, rtol=1e-3)
    assert read_provenance(out)["after"] == {"seed": 1}


def test_a_part_that_does_not_fit_stays_whole(nets, tmp_path):
    """A head of guesses of another size is left alone, also where single weights would fit."""
    other = SpatialEmdNet(dataclasses.replace(SMALL, proposal_hidden=16), 3)
    path, out = tmp_path / "other.safetensors", tmp_path / "average.safetensors"
    save_net(other, path, {}, other.state_dict())
    assert average_weights(nets[0], path, 0.5, out) == ["proposal"]
    before, found = (load_net(path).state_dict() for path in (nets[0], out))
    for name, weight in found.items():
        assert torch.equal(weight, before[name]) == name.startswith("proposal."), name


def test_what_cannot_be_averaged_is_refused(nets, tmp_path):
    """Nets of different kinds, and shares that are none."""
    config = EmdNetConfig(
        grid_size=(16, 16, 4),
        map_counts=(1, 2, 2, 2, 2),
        strides=((2, 2, 1), (2, 2, 2), (2, 2, 2), (2, 2, 1)),
        manipulation_layers=2,
        hidden_size=4,
    )
    path, out = tmp_path / "emd.safetensors", tmp_path / "average.safetensors"
    save_net(EmdNet(config), path, {}, EmdNet(config).state_dict())
    with pytest.raises(InvalidInputError, match="no part"):
        average_weights(nets[0], path, 0.5, out)
    with pytest.raises(InvalidInputError, match="share"):
        average_weights(*nets, 1.5, out)
    assert not out.exists()
