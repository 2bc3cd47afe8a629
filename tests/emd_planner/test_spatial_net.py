"""The net whose codes are maps over the desk."""

from __future__ import annotations

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.architectures import architecture_of, make_net
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.spatial_net import SpatialEmdNet, _on_rim, _sample
from emd_planner.weights import load_net, save_net

SMALL = SpatialNetConfig(widths=(8, 12, 16), moved_width=4, coarse_blocks=1)


@pytest.fixture
def net():
    """A small net none of whose layers is idle."""
    made = SpatialEmdNet(SMALL, seed=1)
    generator = torch.Generator().manual_seed(2)
    for parameter in made.parameters():
        parameter.data += 0.1 * torch.randn(parameter.shape, generator=generator)
    return made


@pytest.fixture
def states():
    """Grids of filled columns."""
    generator = torch.Generator().manual_seed(0)
    tops = torch.randint(0, 17, (3, 32, 32, 1), generator=generator)
    return torch.arange(16) < tops


@pytest.fixture
def hands():
    """Two steps for three clothes."""
    return 1.6 * torch.rand(3, 2, 6, generator=torch.Generator().manual_seed(4)) - 0.8


def test_codes_and_predictions_have_the_grids_plane(net, states, hands):
    """Codes have half the resolution; predictions are probabilities of the grid's size."""
    assert net.encode(states).shape == (3, 8, 16, 16)
    assert net.encode(states[:, None]).shape == (3, 8, 16, 16)
    predicted = net.predict_all(states, hands)
    assert predicted.shape == (3, 2, 32, 32, 16)
    assert 0.0 < predicted.min() and predicted.max() < 1.0
    torch.testing.assert_close(net.predict(states, hands), predicted[:, -1])


def test_a_new_net_predicts_that_nothing_changes():
    """The manipulation module starts as the identity."""
    net = SpatialEmdNet(SMALL)
    codes = torch.rand(2, 8, 16, 16)
    torch.testing.assert_close(net.manipulate(codes, torch.rand(2, 6)), codes)


def test_the_order_of_the_hands_does_not_matter(net, states, hands):
    """Grasp points swapped give the same state."""
    swapped = hands[..., [2, 3, 0, 1, 4, 5]]
    torch.testing.assert_close(net.predict(states, hands), net.predict(states, swapped))


def test_a_shifted_cloth_and_shifted_hands_give_a_shifted_outcome(net, states, hands):
    """By multiples of 8 voxels, what the coarsest maps keep; the plane wraps."""
    shift = torch.tensor([8, -16])
    moved = hands.clone()
    moved[..., :4] += (shift * 2.0 / 32).repeat(2)
    expected = net.predict(states, hands).roll((8, -16), (1, 2))
    predicted = net.predict(states.roll((8, -16), (1, 2)), moved)
    torch.testing.assert_close(predicted, expected, atol=1e-5, rtol=1e-4)


def test_grasp_points_and_displacement_have_gradients(net, states, hands):
    """All six numbers of every step move the prediction."""
    values = hands.requires_grad_(True)
    net.predict(states, values).square().sum().backward()
    assert values.grad.isfinite().all() and (values.grad != 0.0).all()


def test_a_hand_that_stays_where_it_is_gives_finite_gradients(net, states):
    """A displacement of 0 has no direction."""
    values = torch.zeros(3, 1, 6, requires_grad=True)
    net.predict(states, values).sum().backward()
    assert values.grad.isfinite().all()


def test_maps_are_read_at_their_cells_and_across_the_rim():
    """At a centre the cell itself; half-way over the rim the mean of the first and the last."""
    maps = torch.rand(1, 1, 4, 4)
    places = torch.tensor([[[[-0.75, 0.25], [1.0, -0.75], [1.25, 0.25]]]])
    read = _sample(maps, _on_rim(places, (4, 4))).flatten()
    grid = maps[0, 0]
    expected = [grid[0, 2], 0.5 * (grid[3, 0] + grid[0, 0]), grid[0, 2]]
    torch.testing.assert_close(read, torch.stack(expected))


def test_weights_name_their_architecture(net, tmp_path, small_config):
    """Either net is found again by its file."""
    for made in (net, EmdNet(small_config)):
        path = tmp_path / f"{architecture_of(made.config)}.safetensors"
        save_net(made, path, {}, made.state_dict())
        loaded = load_net(path)
        assert type(loaded) is type(made)
        assert loaded.config == made.config
    assert isinstance(make_net(EmdNetConfig()), EmdNet)


def test_grids_that_do_not_fit_are_refused(net):
    """Wrong shapes are told, and so are grids that cannot be halved three times."""
    with pytest.raises(InvalidInputError, match="field of view"):
        net.encode(torch.zeros(1, 16, 32, 16))
    with pytest.raises(InvalidInputError, match="multiples of 8"):
        SpatialNetConfig(grid_size=(30, 32, 16))
