"""The EMD net's architecture (paper, III-A)."""

from __future__ import annotations

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig


@pytest.fixture(scope="module")
def paper_net():
    """The net in the paper's size."""
    return EmdNet(EmdNetConfig(), seed=3)


def test_parameter_count_is_that_of_the_paper(paper_net):
    """19.0 million weights: 4.7 in the encoder, 4.7 in the decoder, 9.5 in the module between."""
    encoder = 27 * (1 * 32 + 32 * 32 + 32 * 64 + 64 * 128 + 128 * 256 + 256 * 512)
    manipulation = 518 * 1024 + 8 * 1030 * 1024 + 1030 * 512
    biases = (32 + 32 + 64 + 128 + 256 + 512) + (256 + 128 + 64 + 32 + 32 + 1) + 9 * 1024 + 512
    count = sum(p.numel() for p in paper_net.parameters())
    assert count == 2 * encoder + manipulation + biases
    assert round(count / 1e6, 1) == 19.0


def test_maps_shrink_and_grow_as_in_the_paper(paper_net):
    """Encoder 32x32x16 -> 1x1x1 by strides 2x2x1 and 2x2x2, decoder back, with its map counts."""
    maps, shapes = torch.rand(2, 32, 32, 16, 1), []
    for layer in paper_net.encoder.layers:
        maps = layer(maps)
        shapes.append(tuple(maps.shape[1:]))
    assert shapes == [
        (16, 16, 16, 32),
        (8, 8, 8, 32),
        (4, 4, 4, 64),
        (2, 2, 2, 128),
        (1, 1, 1, 256),
        (1, 1, 1, 512),
    ]
    grown = []
    for layer in paper_net.decoder.layers:
        maps = layer(maps)
        grown.append(tuple(maps.shape[1:]))
    assert grown == [*shapes[-2::-1], (32, 32, 16, 1)]


def test_manipulation_module_has_the_papers_layers(paper_net):
    """Ten layers: 518 inputs, 1030 between (512 + 512 + 6), 512 outputs."""
    sizes = [(m.in_features, m.out_features) for m in paper_net.manipulation.layers]
    assert sizes == [(518, 1024)] + [(1030, 1024)] * 8 + [(1030, 512)]


def test_initial_weights_lie_in_the_papers_ranges(paper_net):
    """Uniform within 0.05 in encoder and decoder and from manipulations, else within 0.001."""
    for layer in [*paper_net.encoder.layers, *paper_net.decoder.layers]:
        assert layer.weight.abs().max() <= 0.05
        assert layer.weight.detach().std() == pytest.approx(0.1 / 12**0.5, rel=0.1)
    for layer in paper_net.manipulation.layers:
        weight = layer.weight.detach()
        inputs = weight[:, 512:518]
        others = torch.cat([weight[:, :512], weight[:, 518:]], dim=1)
        assert inputs.abs().max() <= 0.05
        assert inputs.std() == pytest.approx(0.1 / 12**0.5, rel=0.1)
        assert others.abs().max() <= 0.001
        assert others.std() == pytest.approx(0.002 / 12**0.5, rel=0.1)


def test_state_section_is_copied_and_added_to():
    """With all weights 0 the module gives back the code: the copies have weights of one."""
    sizes = {"map_counts": (1, 2, 2, 2, 2, 2, 5), "hidden_size": 3}
    net = EmdNet(EmdNetConfig(**sizes, manipulation_activation="identity"))
    for layer in net.manipulation.layers:
        layer.weight.data.zero_()
    codes = torch.rand(4, 5)
    torch.testing.assert_close(net.manipulate(codes, torch.rand(4, 6)), codes)
    net.manipulation.layers[7].bias.data[:5] = 0.5
    torch.testing.assert_close(net.manipulate(codes, torch.rand(4, 6)), codes + 0.5)


def test_every_layer_sees_the_manipulation():
    """The manipulation still matters when only the last layer listens to it."""
    net = EmdNet(EmdNetConfig(map_counts=(1, 2, 2, 2, 2, 2, 5), hidden_size=3))
    for layer in net.manipulation.layers[:-1]:
        layer.weight.data[:, 5:11] = 0.0
    codes = torch.rand(1, 5)
    one = net.manipulate(codes, torch.full((1, 6), 0.5))
    other = net.manipulate(codes, torch.full((1, 6), -0.5))
    assert (one - other).abs().max() > 1e-3


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("depth", [1, 2, 3, 4])
def test_encoder_features_follow_a_cyclic_shift(small_config, axis, depth):
    """A shift of the state by a layer's total stride shifts that layer's features by one."""
    net = EmdNet(small_config).double()
    grids = torch.rand(1, 32, 32, 16, 1, dtype=torch.float64)

    def features(maps):
        for layer in net.encoder.layers[:depth]:
            maps = layer(maps).tanh()
        return maps

    shifted = features(grids.roll(2**depth, axis))
    torch.testing.assert_close(shifted, features(grids).roll(1, axis))


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("depth", [1, 2, 3, 4])
def test_decoder_output_follows_a_cyclic_shift(small_config, axis, depth):
    """A shift by one before the last layers shifts the state by their total stride."""
    net = EmdNet(small_config).double()
    layers = net.decoder.layers[-depth:]
    maps = torch.rand(
        1, *small_config.layer_sizes[depth], small_config.map_counts[depth], dtype=torch.float64
    )

    def states(maps):
        for layer in layers:
            maps = layer(maps).tanh()
        return maps

    torch.testing.assert_close(states(maps.roll(1, axis)), states(maps).roll(2**depth, axis))


def test_predict_applies_the_manipulation_module_recurrently(small_config):
    """Predict is D(M(M(E(s), m0), m1)), and predict_all gives every state on the way."""
    net = EmdNet(small_config)
    grids, moves = torch.rand(3, 32, 32, 16) > 0.8, torch.rand(3, 2, 6)
    once = net.manipulate(net.encode(grids), moves[:, 0])
    twice = net.manipulate(once, moves[:, 1])
    torch.testing.assert_close(net.predict(grids, moves), net.decode(twice))
    every = net.predict_all(grids, moves)
    assert every.shape == (3, 2, 32, 32, 16)
    torch.testing.assert_close(every[:, 0], net.decode(once))
    torch.testing.assert_close(every[:, 1], net(grids, moves))
    assert net.predict_all(grids, moves[:, :0]).shape == (3, 0, 32, 32, 16)


def test_logistic_output_lies_between_empty_and_full(small_config):
    """The prediction is a real value per voxel between 0 and 1."""
    states = EmdNet(small_config).decode(100.0 * torch.randn(2, 32))
    assert states.min() >= 0.0
    assert states.max() <= 1.0


def test_same_seed_gives_the_same_net(small_config):
    """Initial weights depend on the seed alone."""
    one, same, other = (EmdNet(small_config, seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(one[name], same[name]) for name in one)
    assert not torch.equal(one["encoder.layers.0.weight"], other["encoder.layers.0.weight"])


def test_bfloat16_predicts_nearly_the_same(small_config):
    """Computing in bfloat16 changes predictions by about a hundredth."""
    net = EmdNet(small_config)
    grids, moves = torch.rand(2, 32, 32, 16) > 0.8, torch.rand(2, 2, 6)
    exact = net.predict(grids, moves)
    net.compute_type = torch.bfloat16
    assert (net.predict(grids, moves) - exact).abs().max() < 0.02


def test_wrong_shapes_are_refused(small_config):
    """A grid of another size, or strides that do not end in one voxel, are said to be wrong."""
    with pytest.raises(InvalidInputError, match="voxelise"):
        EmdNet(small_config).encode(torch.zeros(1, 16, 16, 16))
    with pytest.raises(InvalidInputError, match="1 x 1 x 1"):
        EmdNetConfig(map_counts=(1, 4), strides=((2, 2, 2),))
    with pytest.raises(InvalidInputError, match="one longer"):
        EmdNetConfig(map_counts=(1, 4, 8))
