"""Layers on maps (B, C, X, Y) that are periodic in x and y, channels last in memory.

They compute in the type of their input, whatever the type of their weights.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional


class Dense(nn.Linear):
    """A full layer."""

    def forward(self, values: Tensor) -> Tensor:
        """Apply the layer to (..., C)."""
        return functional.linear(values, self.weight.to(values.dtype), self.bias.to(values.dtype))


class Pointwise(nn.Conv2d):
    """A 1 x 1 convolution."""

    def __init__(self, inputs: int, outputs: int) -> None:
        """Make a layer with random weights."""
        super().__init__(inputs, outputs, 1)

    def forward(self, maps: Tensor) -> Tensor:
        """Convolve."""
        return _apply(self, channels_last(maps).permute(0, 2, 3, 1))


class Halve(nn.Conv2d):
    """Half the resolution by a 2 x 2 convolution of stride 2."""

    def __init__(self, inputs: int, outputs: int) -> None:
        """Make a layer with random weights."""
        super().__init__(inputs, outputs, 2, stride=2)

    def forward(self, maps: Tensor) -> Tensor:
        """Convolve."""
        cells = channels_last(maps).permute(0, 2, 3, 1)
        blocks = cells.unflatten(2, (-1, 2)).unflatten(1, (-1, 2)).transpose(2, 3)
        return _apply(self, blocks.flatten(3))


class Double(nn.Module):
    """Twice the resolution: a 1 x 1 convolution to four cells each."""

    def __init__(self, inputs: int, outputs: int) -> None:
        """Make a layer with random weights."""
        super().__init__()
        self.four = Pointwise(inputs, 4 * outputs)

    def forward(self, maps: Tensor) -> Tensor:
        """Convolve and spread."""
        return channels_last(functional.pixel_shuffle(self.four(maps), 2))


class Residual(nn.Module):
    """Two periodic 3 x 3 convolutions, added; at first they add nothing.

    Attributes:
        cells: Of the maps that it is made for, along x and y.
    """

    def __init__(self, width: int, cells: tuple[int, int]) -> None:
        """Make a block with random weights, but for the last layer's, which are 0."""
        super().__init__()
        self.cells = cells
        self.first = nn.Conv2d(width, width, 3)
        self.second = nn.Conv2d(width, width, 3)
        start_at_zero(self.second)

    @property
    def layers(self) -> tuple[nn.Conv2d, nn.Conv2d]:
        """The two convolutions in their order."""
        return self.first, self.second

    def forward(self, maps: Tensor) -> Tensor:
        """Add what the convolutions give."""
        change = _convolve(periodic_rim(functional.relu(maps)), self.first)
        return maps + _convolve(periodic_rim(functional.relu(change)), self.second)


def start_at_zero(layer: nn.Module) -> None:
    """Let what is added to maps begin as nothing."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)


def channels_last(maps: Tensor) -> Tensor:
    """Lay channels last in memory, which convolutions on a CPU are fastest with."""
    return maps.contiguous(memory_format=torch.channels_last)


def periodic_rim(maps: Tensor) -> Tensor:
    """Pad x and y periodically by one cell."""
    return _PeriodicRim.apply(maps)


class _PeriodicRim(torch.autograd.Function):
    """Periodic padding in few copies; `functional.pad` takes longer than the convolution."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor) -> Tensor:
        batch, width, x, y = maps.shape
        ringed = torch.empty(
            (batch, width, x + 2, y + 2),
            dtype=maps.dtype,
            device=maps.device,
            memory_format=torch.channels_last,
        )
        ringed[:, :, 1:-1, 1:-1] = maps
        ringed[:, :, 0, 1:-1] = maps[:, :, -1]
        ringed[:, :, -1, 1:-1] = maps[:, :, 0]
        ringed[:, :, :, 0] = ringed[:, :, :, -2]
        ringed[:, :, :, -1] = ringed[:, :, :, 1]
        return ringed

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        inner = gradient[:, :, :, 1:-1].clone(memory_format=torch.channels_last)
        inner[:, :, :, 0] += gradient[:, :, :, -1]
        inner[:, :, :, -1] += gradient[:, :, :, 0]
        inner[:, :, 1] += inner[:, :, -1]
        inner[:, :, -2] += inner[:, :, 0]
        return inner[:, :, 1:-1]


def _convolve(maps: Tensor, layer: nn.Conv2d) -> Tensor:
    kind = maps.dtype
    weight = layer.weight.to(kind, memory_format=torch.channels_last)
    bias = None if layer.bias is None else layer.bias.to(kind)
    return functional.conv2d(channels_last(maps), weight, bias, layer.stride)


def _apply(layer: nn.Conv2d, patches: Tensor) -> Tensor:
    """Convolve by one product: patches (B, X, Y, N), one for each cell, to maps (B, C, X, Y).

    On a CPU that is faster than the convolution of few small maps.
    """
    weight = layer.weight.to(patches.dtype).permute(0, 2, 3, 1).flatten(1)
    bias = None if layer.bias is None else layer.bias.to(patches.dtype)
    return functional.linear(patches, weight, bias).permute(0, 3, 1, 2)
