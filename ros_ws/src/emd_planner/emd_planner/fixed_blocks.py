"""Residual blocks whose weights stay: what a search for manipulations runs (ours).

A search puts few maps at a time through weights that do not change, again and again, and asks for
gradients of the maps only. So weights are prepared once, the way back takes the prepared ones too,
and a block is one step for autograd.

A convolution on a torus multiplies each Fourier coefficient of the maps with one of the kernel's.
For 4 x 4 cells that takes 25 products of channels by channels instead of 144, for 8 x 8 cells 121
instead of 576. On larger maps turning them costs more than the products save.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from emd_planner.convolution_blocks import Residual, channels_last, periodic_rim

MOST_CELLS = 8  # along a side of maps that are convolved by Fourier coefficients


class FixedResidual(nn.Module):
    """Does what a `Residual` does, with fixed weights, in float32."""

    def __init__(self, block: Residual) -> None:
        """Prepare a block's weights."""
        super().__init__()
        self.first, self.second = (_prepared(layer, block.cells) for layer in block.layers)

    def forward(self, maps: Tensor) -> Tensor:
        """Add what the convolutions give to maps (B, C, X, Y)."""
        return _Residual.apply(maps, self.first, self.second)


def fix_residuals(net: nn.Module) -> None:
    """Put fixed blocks in the place of a net's residual blocks."""
    for parent in list(net.modules()):
        for name, block in list(parent.named_children()):
            if isinstance(block, Residual):
                setattr(parent, name, FixedResidual(block))


class _Residual(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, maps: Tensor, first: _Convolution, second: _Convolution) -> Tensor:
        inner = first(functional.relu(maps)).relu_()
        ctx.save_for_backward(maps, inner)
        ctx.layers = first, second
        return maps + second(inner)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        maps, inner = ctx.saved_tensors
        first, second = ctx.layers
        back = second.transposed(channels_last(gradient)) * (inner > 0.0)
        return gradient + first.transposed(back) * (maps > 0.0), None, None


class _Convolution(nn.Module, ABC):
    """A 3 x 3 convolution of maps (B, C, X, Y) whose opposite edges meet, and its transpose."""

    @abstractmethod
    def forward(self, maps: Tensor) -> Tensor:
        """Convolve."""

    @abstractmethod
    def transposed(self, maps: Tensor) -> Tensor:
        """Apply the transpose, without the bias."""


def _prepared(layer: nn.Conv2d, cells: tuple[int, int]) -> _Convolution:
    return (_ByCoefficients if max(cells) <= MOST_CELLS else _Direct)(layer, cells)


class _Direct(_Convolution):
    """With a rim of cells from the opposite edges."""

    def __init__(self, layer: nn.Conv2d, cells: tuple[int, int]) -> None:
        super().__init__()
        mirrored = layer.weight.flip(2, 3).transpose(0, 1)
        self.weight, self.mirrored = (_fixed(channels_last(w)) for w in (layer.weight, mirrored))
        self.bias = _fixed(_bias_of(layer))

    def forward(self, maps: Tensor) -> Tensor:
        return functional.conv2d(periodic_rim(maps), self.weight, self.bias)

    def transposed(self, maps: Tensor) -> Tensor:
        return functional.conv2d(periodic_rim(maps), self.mirrored)


class _ByCoefficients(_Convolution):
    """With the kernel's Fourier coefficients, `products`, shape (Rx * Ry, C_in, C_out)."""

    def __init__(self, layer: nn.Conv2d, cells: tuple[int, int]) -> None:
        super().__init__()
        turns = [_coefficients(count) for count in cells]
        of_kernel = [turn[:, [1, 0, -1]] for turn in turns]  # its offsets are -1, 0 and 1
        products = torch.einsum("ri,sj,ocij->rsco", *of_kernel, layer.weight.double())
        self.products = _fixed(products.flatten(0, 1))
        self.bias = _fixed(_bias_of(layer))
        self.turns = nn.ParameterList(_fixed(turn) for turn in turns)
        self.returns = nn.ParameterList(_fixed(_back(count)) for count in cells)

    def forward(self, maps: Tensor) -> Tensor:
        there, back = list(self.turns), list(self.returns)
        return _multiplied(maps, there, self.products, back, self.bias)

    def transposed(self, maps: Tensor) -> Tensor:
        there, back = [turn.t() for turn in self.returns], [turn.t() for turn in self.turns]
        return _multiplied(maps, there, self.products.mT, back, 0.0)


def _multiplied(
    maps: Tensor,
    there: Sequence[Tensor],
    products: Tensor,
    back: Sequence[Tensor],
    bias: Tensor | float,
) -> Tensor:
    """Turn maps (B, C, X, Y) along x and y, multiply, turn back, and add a bias."""
    batch, channels, x, y = maps.shape
    laid = maps.permute(2, 3, 0, 1).reshape(x, y, batch * channels)
    turned = _along_both(there, laid).view(-1, batch, channels)
    changed = torch.bmm(turned, products).view(len(there[0]), len(there[1]), -1)
    out = _along_both(back, changed).view(x, y, batch, -1)
    return (out + bias).permute(2, 3, 0, 1)


def _along_both(turns: Sequence[Tensor], maps: Tensor) -> Tensor:
    """Turn maps (X, Y, N) along x, then along y."""
    along_x, along_y = turns
    turned = (along_x @ maps.flatten(1)).view(-1, *maps.shape[1:])
    return along_y @ turned


def _fixed(values: Tensor) -> nn.Parameter:
    return nn.Parameter(values.detach().float(), requires_grad=False)


def _bias_of(layer: nn.Conv2d) -> Tensor:
    assert layer.bias is not None
    return layer.bias


# Of a real sequence of n values the coefficient of frequency k is a - i b. The product of two of
# them takes three products of real numbers (Karatsuba): of a, of b and of a + b. Those of the
# frequencies 0 and n / 2 are real.


def _coefficients(count: int) -> Tensor:
    """Give the matrix (R, n) from n values to a, b and a + b of each frequency."""
    rows = []
    for frequency, (cosine, sine) in enumerate(_waves(count)):
        rows += [cosine] if _is_real(frequency, count) else [cosine, sine, cosine + sine]
    return torch.stack(rows)


def _back(count: int) -> Tensor:
    """Give the matrix (n, R) from the products of `_coefficients` to the values."""
    columns = []
    for frequency, (cosine, sine) in enumerate(_waves(count)):
        if _is_real(frequency, count):
            columns += [cosine / count]
        else:
            share = 2.0 / count
            columns += [share * (cosine - sine), -share * (cosine + sine), share * sine]
    return torch.stack(columns, 1)


def _waves(count: int) -> list[tuple[Tensor, Tensor]]:
    """Give cosine and sine, each (n,), of the frequencies 0 to n / 2."""
    places = 2.0 * math.pi / count * torch.arange(count, dtype=torch.float64)
    return [((k * places).cos(), (k * places).sin()) for k in range(count // 2 + 1)]


def _is_real(frequency: int, count: int) -> bool:
    return frequency in (0, count // 2)
