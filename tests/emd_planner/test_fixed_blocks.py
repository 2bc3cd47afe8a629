"""Residual blocks with fixed weights."""

from __future__ import annotations

import pytest
import torch

from emd_planner.convolution_blocks import Residual
from emd_planner.fixed_blocks import FixedResidual, fix_residuals
from emd_planner.spatial_net import SpatialEmdNet


def _block(width: int, cells: tuple[int, int]) -> Residual:
    """A block none of whose weights is 0."""
    made = Residual(width, cells)
    generator = torch.Generator().manual_seed(0)
    for parameter in made.parameters():
        parameter.data = torch.randn(parameter.shape, generator=generator)
    return made


# By Fourier coefficients, the smallest torus among them, of unequal sides too; then directly.
@pytest.mark.parametrize("cells", [(2, 2), (4, 4), (8, 8), (8, 4), (16, 16), (16, 4)])
def test_a_fixed_block_does_the_same_there_and_back(cells):
    """Maps and their gradient are those of the block itself."""
    block = _block(3, cells)
    fixed = FixedResidual(block)
    generator = torch.Generator().manual_seed(1)
    maps = torch.randn(2, 3, *cells, generator=generator, requires_grad=True)
    weights = torch.randn(2, 3, *cells, generator=generator)
    wanted, found = block(maps), fixed(maps)
    torch.testing.assert_close(found, wanted, atol=1e-4, rtol=1e-5)
    gradients = [torch.autograd.grad((out * weights).sum(), maps)[0] for out in (wanted, found)]
    torch.testing.assert_close(gradients[1], gradients[0], atol=1e-3, rtol=1e-5)


def test_a_net_keeps_no_other_blocks_and_predicts_the_same():
    """All its residual blocks are replaced, in lists of layers too."""
    net = SpatialEmdNet(seed=1)
    generator = torch.Generator().manual_seed(2)
    for parameter in net.parameters():
        parameter.data += 0.02 * torch.randn(parameter.shape, generator=generator)
    states = torch.arange(16) < torch.randint(0, 17, (2, 32, 32, 1), generator=generator)
    hands = torch.rand(2, 2, 6, generator=generator) - 0.5
    with torch.no_grad():
        wanted = net.predict(states, hands)
        fix_residuals(net)
        torch.testing.assert_close(net.predict(states, hands), wanted, atol=1e-4, rtol=1e-4)
    assert not any(isinstance(module, Residual) for module in net.modules())
    assert sum(isinstance(module, FixedResidual) for module in net.modules()) >= 9
