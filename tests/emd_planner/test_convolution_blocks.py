"""Layers on periodic maps."""

from __future__ import annotations

import torch

from emd_planner.convolution_blocks import Double, Halve, Pointwise, Residual, periodic_rim


def test_periodic_padding_equals_torchs():
    """The same rim, and its exact gradient."""
    maps = torch.randn(2, 3, 4, 5, dtype=torch.double, requires_grad=True)
    padded = torch.nn.functional.pad(maps, (1, 1, 1, 1), mode="circular")
    torch.testing.assert_close(periodic_rim(maps), padded)
    assert torch.autograd.gradcheck(periodic_rim, (maps,))


def test_layers_compute_in_the_type_of_their_input():
    """Weights are float32, the maps of either type."""
    maps = torch.rand(2, 8, 4, 4)
    for layer in (Pointwise(8, 8), Halve(8, 8), Double(8, 8), Residual(8, (4, 4))):
        exact, coarse = layer(maps), layer(maps.bfloat16())
        assert coarse.dtype == torch.bfloat16
        torch.testing.assert_close(coarse.float(), exact, atol=0.03, rtol=0.03)


def test_halving_and_doubling_change_the_resolution():
    """Four cells become one, and one four."""
    maps = torch.rand(1, 3, 8, 4)
    assert Halve(3, 5)(maps).shape == (1, 5, 4, 2)
    assert Double(3, 5)(maps).shape == (1, 5, 16, 8)


def test_a_residual_block_begins_as_the_identity():
    """Until it is trained."""
    maps = torch.rand(1, 3, 8, 4)
    torch.testing.assert_close(Residual(3, (8, 4))(maps), maps)
