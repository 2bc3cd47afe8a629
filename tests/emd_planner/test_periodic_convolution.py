"""Convolutions that wrap in x and y."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional

from emd_planner.periodic_convolution import PeriodicConvolution, PeriodicTransposedConvolution

CASES = [
    ((8, 8, 4), (2, 2, 1), 1, 3),
    ((8, 8, 4), (2, 2, 2), 4, 3),
    ((2, 2, 2), (2, 2, 2), 5, 2),
    ((1, 1, 1), (2, 2, 2), 4, 6),
    ((6, 4, 3), (2, 2, 1), 2, 2),
]


def _layer(kind, size, stride, fine_maps, coarse_maps):
    generator = torch.Generator().manual_seed(1)
    if kind is PeriodicConvolution:
        layer = kind(fine_maps, coarse_maps, size, stride, bias=True)
    else:
        layer = kind(coarse_maps, fine_maps, size, stride, bias=True)
    layer = layer.double()
    for parameter in layer.parameters():
        parameter.data.uniform_(-1, 1, generator=generator)
    return layer


def _wrapped(maps):
    maps = functional.pad(maps, (0, 0, 1, 1, 1, 1), mode="circular")
    return functional.pad(maps, (1, 1))


@pytest.mark.parametrize(("size", "stride", "fine", "coarse"), CASES)
def test_convolution_equals_conv3d_after_circular_padding(size, stride, fine, coarse):
    """A layer gives what torch's conv3d gives on circularly padded maps."""
    layer = _layer(PeriodicConvolution, size, stride, fine, coarse)
    maps = torch.rand(3, *size, fine, dtype=torch.float64)
    wanted = functional.conv3d(
        _wrapped(maps.movedim(4, 1)), layer.weight.permute(4, 3, 0, 1, 2), layer.bias, stride
    )
    torch.testing.assert_close(layer(maps).movedim(4, 1), wanted)


@pytest.mark.parametrize(("size", "stride", "fine", "coarse"), CASES)
def test_transposed_convolution_is_the_adjoint(size, stride, fine, coarse):
    """<A x, y> = <x, A^T y> for the convolution A and the transposed layer of the same weights."""
    layer = _layer(PeriodicConvolution, size, stride, fine, coarse)
    transposed = _layer(PeriodicTransposedConvolution, size, stride, fine, coarse)
    transposed.weight.data = layer.weight.data
    layer.bias.data.zero_()
    transposed.bias.data.zero_()
    x = torch.rand(2, *size, fine, dtype=torch.float64)
    y = torch.rand_like(layer(x))
    torch.testing.assert_close((layer(x) * y).sum(), (x * transposed(y)).sum())


@pytest.mark.parametrize("kind", [PeriodicConvolution, PeriodicTransposedConvolution])
@pytest.mark.parametrize(("size", "stride", "fine", "coarse"), CASES)
def test_gradients_equal_finite_differences(kind, size, stride, fine, coarse):
    """The hand-written gradients of maps and weights agree with finite differences."""
    layer = _layer(kind, size, stride, fine, coarse)
    if kind is PeriodicConvolution:
        maps = torch.rand(2, *size, fine, dtype=torch.float64, requires_grad=True)
    else:
        coarse_size = [-(-n // s) for n, s in zip(size, stride, strict=True)]
        maps = torch.rand(2, *coarse_size, coarse, dtype=torch.float64, requires_grad=True)
    weight, bias = layer.weight.detach().requires_grad_(), layer.bias.detach().requires_grad_()

    def apply(maps, weight, bias):
        return torch.func.functional_call(layer, {"weight": weight, "bias": bias}, (maps,))

    assert torch.autograd.gradcheck(apply, (maps, weight, bias), fast_mode=True)


@pytest.mark.parametrize("axis", [1, 2])
def test_cyclic_shift_by_the_stride_shifts_the_features_by_one(axis):
    """A layer keeps cyclic shifts along x and y, its transpose as well."""
    size, stride = (8, 8, 4), (2, 2, 2)
    layer = _layer(PeriodicConvolution, size, stride, 3, 2)
    maps = torch.rand(1, *size, 3, dtype=torch.float64)
    torch.testing.assert_close(layer(maps.roll(2, axis)), layer(maps).roll(1, axis))
    transposed = _layer(PeriodicTransposedConvolution, size, stride, 3, 2)
    coarse = torch.rand(1, 4, 4, 2, 2, dtype=torch.float64)
    torch.testing.assert_close(transposed(coarse.roll(1, axis)), transposed(coarse).roll(2, axis))


def test_z_does_not_wrap():
    """What lies on the desk is not seen by the voxels at the top."""
    layer = _layer(PeriodicConvolution, (4, 4, 8), (2, 2, 1), 1, 2)
    maps = torch.zeros(1, 4, 4, 8, 1, dtype=torch.float64)
    maps[..., 0, :] = 1.0
    out = layer(maps) - layer(torch.zeros_like(maps))
    assert out[..., :2, :].abs().min() > 0
    assert out[..., 2:, :].abs().max() == 0


def test_patches_gathered_in_chunks_change_nothing(monkeypatch):
    """The result does not depend on how many examples are gathered at a time."""
    layer = _layer(PeriodicConvolution, (8, 8, 4), (2, 2, 2), 3, 2)
    maps = torch.rand(5, 8, 8, 4, 3, dtype=torch.float64)
    whole = layer(maps)
    monkeypatch.setattr("emd_planner.periodic_convolution._PATCH_ELEMENTS", 1)
    torch.testing.assert_close(layer(maps), whole)


def test_bfloat16_is_close_to_float32():
    """In bfloat16 outputs keep two digits and the weights' gradient stays float32."""
    layer = _layer(PeriodicConvolution, (8, 8, 4), (2, 2, 2), 4, 3).float()
    maps = torch.rand(2, 8, 8, 4, 4)
    exact, rounded = layer(maps), layer(maps.bfloat16())
    torch.testing.assert_close(rounded.float(), exact, rtol=0.02, atol=0.05)
    rounded.float().sum().backward()
    assert layer.weight.grad.dtype == torch.float32
