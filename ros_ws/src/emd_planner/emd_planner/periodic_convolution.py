"""3 x 3 x 3 convolutions, periodic in x and y, and their transposes, as matrix products.

Maps lie with their channels last, (B, X, Y, Z, C), and a layer is one matrix product of gathered
patches with a weight matrix. Encoder and decoder then share three kernels, the transposed layer is
the exact transpose of the other one, and in bfloat16 on a CPU this takes about an eighth of the
time of `torch.nn.functional.conv3d` after circular padding (which the tests compare it with).

A layer of stride s takes voxels s * i - 1 .. s * i + 1 to its output voxel i, so a cyclic shift of
its input by s shifts its output by one. z has zeros outside, as the desk and the air do not wrap.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor, nn

Size = tuple[int, int, int]

# Patches are gathered for a few examples at a time, so that they stay in the processor's cache.
_PATCH_ELEMENTS = 2**21


class PeriodicConvolution(nn.Module):
    """A convolution with stride, from maps (B, X, Y, Z, C_in) to (B, X', Y', Z', C_out).

    Attributes:
        weight: Shape (3, 3, 3, C_in, C_out), offsets along x, y and z first.
        bias: Shape (C_out,), or None.
    """

    def __init__(
        self, input_maps: int, output_maps: int, size: Size, stride: Size, bias: bool
    ) -> None:
        """Make a layer for inputs of `size` voxels; the weights are set by the caller."""
        super().__init__()
        self.size, self.stride = size, stride
        self.weight = nn.Parameter(torch.zeros(3, 3, 3, input_maps, output_maps))
        self.bias = nn.Parameter(torch.zeros(output_maps)) if bias else None

    def forward(self, maps: Tensor) -> Tensor:
        """Convolve, in the type of `maps`."""
        if self.size == (1, 1, 1):
            out = maps @ _single_voxel_weight(self.weight).to(maps.dtype)
        else:
            out = _Convolve.apply(maps, self.weight, self.stride)
        return out if self.bias is None else out + self.bias.to(out.dtype)


class PeriodicTransposedConvolution(nn.Module):
    """The transpose of `PeriodicConvolution`, from maps of coarse to maps of fine voxels.

    Attributes:
        weight: Shape (3, 3, 3, C_out, C_in), offsets along x, y and z first: that of the layer
            which it transposes.
        bias: Shape (C_out,), or None.
    """

    def __init__(
        self, input_maps: int, output_maps: int, size: Size, stride: Size, bias: bool
    ) -> None:
        """Make a layer for outputs of `size` voxels; the weights are set by the caller."""
        super().__init__()
        self.size, self.stride = size, stride
        self.weight = nn.Parameter(torch.zeros(3, 3, 3, output_maps, input_maps))
        self.bias = nn.Parameter(torch.zeros(output_maps)) if bias else None

    def forward(self, maps: Tensor) -> Tensor:
        """Apply the transposed convolution, in the type of `maps`."""
        if self.size == (1, 1, 1):
            out = maps @ _single_voxel_weight(self.weight).to(maps.dtype).t()
        else:
            out = _ConvolveTransposed.apply(maps, self.weight, self.stride, self.size)
        return out if self.bias is None else out + self.bias.to(out.dtype)


def _single_voxel_weight(weight: Tensor) -> Tensor:
    """Sum the offsets that a map of one voxel sees: all along x and y (it wraps), one along z."""
    return weight[:, :, 1].sum((0, 1))


class _Convolve(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, maps: Tensor, weight: Tensor, stride: Size) -> Tensor:
        padded = _pad(maps)
        ctx.save_for_backward(padded, weight)
        ctx.stride, ctx.size = stride, tuple(maps.shape[1:4])
        return _convolve(padded, weight, stride)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        padded, weight = ctx.saved_tensors
        wants_maps, wants_weight = ctx.needs_input_grad[:2]
        return (
            _convolve_transposed(gradient, weight, ctx.stride, ctx.size) if wants_maps else None,
            _weight_gradient(padded, gradient, weight, ctx.stride) if wants_weight else None,
            None,
        )


class _ConvolveTransposed(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, maps: Tensor, weight: Tensor, stride: Size, size: Size) -> Tensor:
        ctx.save_for_backward(maps, weight)
        ctx.stride = stride
        return _convolve_transposed(maps, weight, stride, size)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        maps, weight = ctx.saved_tensors
        wants_maps, wants_weight = ctx.needs_input_grad[:2]
        padded = _pad(gradient)
        return (
            _convolve(padded, weight, ctx.stride) if wants_maps else None,
            _weight_gradient(padded, maps, weight, ctx.stride) if wants_weight else None,
            None,
            None,
        )


def _pad(maps: Tensor) -> Tensor:
    """Add one voxel on each side: the opposite edge in x and y, zeros in z."""
    batch, x, y, z, channels = maps.shape
    padded = maps.new_empty(batch, x + 2, y + 2, z + 2, channels)
    padded[:, :, :, 0] = padded[:, :, :, -1] = 0.0
    padded[:, 1:-1, 1:-1, 1:-1] = maps
    padded[:, 0], padded[:, -1] = padded[:, -2], padded[:, 1]
    padded[:, :, 0], padded[:, :, -1] = padded[:, :, -2], padded[:, :, 1]
    return padded


def _fold(padded: Tensor) -> Tensor:
    """Transpose `_pad`: add the margins to the edges that they were copied from."""
    padded[:, :, -2] += padded[:, :, 0]
    padded[:, :, 1] += padded[:, :, -1]
    padded[:, -2] += padded[:, 0]
    padded[:, 1] += padded[:, -1]
    return padded[:, 1:-1, 1:-1, 1:-1]


def _output_size(padded: Tensor, stride: Size) -> Size:
    x, y, z = (-(-(n - 2) // s) for n, s in zip(padded.shape[1:4], stride, strict=True))
    return x, y, z


def _chunks(batch: int, elements: int, device: torch.device) -> Iterator[slice]:
    """Cut a batch into runs whose patches fit the cache (on a CPU)."""
    length = max(1, _PATCH_ELEMENTS // elements) if device.type == "cpu" else batch
    for start in range(0, batch, length):
        yield slice(start, start + length)


def _offsets(padded: Tensor, stride: Size, size: Size) -> Iterator[Tensor]:
    """Give, for each of the 27 offsets, the view of the voxels that meet it."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                yield padded[
                    :,
                    i : i + stride[0] * (size[0] - 1) + 1 : stride[0],
                    j : j + stride[1] * (size[1] - 1) + 1 : stride[1],
                    k : k + stride[2] * (size[2] - 1) + 1 : stride[2],
                ]


def _patches(padded: Tensor, stride: Size, size: Size) -> Tensor:
    """Gather patches, shape (B * X' * Y' * Z', 27 * C)."""
    channels = padded.shape[4]
    if channels == 1:  # copying whole rows of an offset is faster than single voxels
        return torch.stack(list(_offsets(padded, stride, size))).view(27, -1).t()
    s = padded.stride()
    shape = (padded.shape[0], *size, 3, 3, 3, channels)
    strides = (s[0], s[1] * stride[0], s[2] * stride[1], s[3] * stride[2], *s[1:])
    view = padded.as_strided(shape, strides, padded.storage_offset())
    return view.reshape(-1, 27 * channels)


def _convolve(padded: Tensor, weight: Tensor, stride: Size) -> Tensor:
    batch, size = padded.shape[0], _output_size(padded, stride)
    matrix = weight.reshape(-1, weight.shape[4]).to(padded.dtype)
    out = padded.new_empty(batch, *size, matrix.shape[1])
    elements = size[0] * size[1] * size[2] * matrix.shape[0]
    for chunk in _chunks(batch, elements, padded.device):
        rows = out[chunk].view(-1, matrix.shape[1])
        torch.mm(_patches(padded[chunk], stride, size), matrix, out=rows)
    return out


def _convolve_transposed(maps: Tensor, weight: Tensor, stride: Size, out_size: Size) -> Tensor:
    batch, channels = maps.shape[0], weight.shape[3]
    size = (maps.shape[1], maps.shape[2], maps.shape[3])
    matrix = weight.reshape(-1, weight.shape[4]).to(maps.dtype)
    padded = maps.new_zeros(batch, *(n + 2 for n in out_size), channels)
    maps = maps.contiguous()
    elements = size[0] * size[1] * size[2] * matrix.shape[0]
    for chunk in _chunks(batch, elements, maps.device):
        rows = maps[chunk].view(-1, maps.shape[4])
        if channels == 1:
            patches = torch.mm(matrix, rows.t()).view(27, -1, *size, 1).unbind(0)
        else:
            patches = torch.mm(rows, matrix.t()).view(-1, *size, 27, channels).unbind(4)
        for view, patch in zip(_offsets(padded[chunk], stride, size), patches, strict=True):
            view += patch
    return _fold(padded)


def _weight_gradient(padded: Tensor, maps: Tensor, weight: Tensor, stride: Size) -> Tensor:
    batch, size = padded.shape[0], _output_size(padded, stride)
    maps = maps.contiguous()
    total = weight.new_zeros(weight[..., 0].numel(), weight.shape[4])
    elements = size[0] * size[1] * size[2] * total.shape[0]
    for chunk in _chunks(batch, elements, maps.device):
        rows = maps[chunk].view(-1, maps.shape[4])
        total += torch.mm(_patches(padded[chunk], stride, size).t(), rows)
    return total.view(weight.shape)
