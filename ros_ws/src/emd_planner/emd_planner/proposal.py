"""Guesses of the next manipulation from the present and the wanted state (ours).

A search by back-propagation begins somewhere. What lies between two states is mostly plain to see,
so a small head on the codes learns from the data what a hand does there: a mixture of normal
distributions over grasp points and displacement, and how likely a second hand grasps too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from emd_planner.convolution_blocks import Dense, Halve, Pointwise, Residual
from emd_planner.net_config import SpatialNetConfig

_LONGEST = 6  # steps to the goal that are told apart
_SMALLEST_SCALE = 0.02  # normalised: a third of a voxel's width
_VALUES = 6
_SWAPPED = [2, 3, 0, 1, 4, 5]


@dataclass(frozen=True)
class Proposals:
    """A mixture of K distributions over a manipulation.

    Attributes:
        weights: Logits, shape (B, K).
        both: Logit of both hands grasping, shape (B, K); with one hand it is the first.
        means: x0 y0 x1 y1 dx dy, normalised, shape (B, K, 6).
        scales: Standard deviations, shape (B, K, 6).
    """

    weights: Tensor
    both: Tensor
    means: Tensor
    scales: Tensor

    def expand(self, count: int) -> Proposals:
        """Repeat the mixture of a single state, K as before, for `count` draws."""
        parts = (self.weights, self.both, self.means, self.scales)
        return Proposals(*(part.expand(count, *part.shape[1:]) for part in parts))

    def log_likelihood(self, manipulations: Tensor, used: Tensor) -> Tensor:
        """Log density of manipulations; hands may be given in either order.

        Args:
            manipulations: Shape (B, 6), finite.
            used: Which hands grasp, boolean, shape (B, 2).

        Returns:
            Shape (B,); 0 where no hand grasps.
        """
        straight = self._of_order(manipulations, used)
        crossed = self._of_order(manipulations[:, _SWAPPED], used.flip(1))
        return torch.where(used.any(1), torch.logaddexp(straight, crossed), 0.0)

    def _of_order(self, manipulations: Tensor, used: Tensor) -> Tensor:
        """Log density of the hands in this order; -inf where only the second one grasps."""
        distance = (manipulations[:, None] - self.means) / self.scales
        density = -0.5 * distance.square() - self.scales.log() - 0.5 * math.log(2.0 * math.pi)
        counts = used.repeat_interleave(2, 1)
        counts = torch.cat([counts, counts.new_ones(len(counts), 2)], 1)
        inside = torch.where(counts[:, None], density, 0.0).sum(2)
        hands = torch.where(
            used[:, 1:], functional.logsigmoid(self.both), functional.logsigmoid(-self.both)
        )
        mixed = torch.logsumexp(self.weights.log_softmax(1) + hands + inside, 1)
        return torch.where(used[:, 0], mixed, -torch.inf)

    def draw(self, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Draw one manipulation from each mixture.

        Args:
            generator: On the CPU.

        Returns:
            Manipulations (B, 6), whose second point means nothing where it is not used, and
            whether the second hand grasps (B,).
        """
        weights = self.weights.softmax(1).cpu()
        part = torch.multinomial(weights, 1, generator=generator).to(self.means.device)
        rows = torch.arange(len(part), device=part.device)
        part = part[:, 0]
        noise = torch.randn((len(part), _VALUES), generator=generator).to(self.means)
        chance = torch.rand(len(part), generator=generator).to(self.means)
        values = self.means[rows, part] + noise * self.scales[rows, part]
        return values, chance < self.both[rows, part].sigmoid()


class ProposalHead(nn.Module):
    """Convolutions over two codes side by side, down to one vector, to a mixture."""

    def __init__(self, width: int, cells: tuple[int, int], config: SpatialNetConfig) -> None:
        """Make a head for codes of `width` maps of `cells`, both multiples of 4."""
        super().__init__()
        fine, middle, coarse = config.proposal_widths
        blocks, components = config.proposal_blocks, config.proposals
        half, quarter = (cells[0] // 2, cells[1] // 2), (cells[0] // 4, cells[1] // 4)
        self.trunk = nn.Sequential(
            Pointwise(3 * width, fine),
            *(Residual(fine, cells) for _ in range(blocks)),
            Halve(fine, middle),
            *(Residual(middle, half) for _ in range(blocks)),
            Halve(middle, coarse),
            *(Residual(coarse, quarter) for _ in range(blocks)),
            nn.ReLU(),
            nn.Flatten(),
        )
        seen = coarse * quarter[0] * quarter[1]
        self.hidden = Dense(seen + _LONGEST, config.proposal_hidden)
        self.out = Dense(config.proposal_hidden, components * (2 + 2 * _VALUES))
        with torch.no_grad():  # the parts of the mixture begin at different places
            self.out.bias.view(components, -1)[:, 2 : 2 + _VALUES].uniform_(-0.6, 0.6)

    def forward(self, codes: Tensor, goals: Tensor, steps: Tensor, kind: torch.dtype) -> Proposals:
        """Guess the manipulation that follows a state.

        Args:
            codes: Of the present states, shape (B, C, X, Y).
            goals: Of the wanted states, likewise.
            steps: Manipulations that lead there, shape (B,), from 1; more than 6 count as 6.
            kind: Type to compute in.
        """
        seen = self.trunk(torch.cat([codes, goals, goals - codes], 1).to(kind))
        left = functional.one_hot(steps.clamp(1, _LONGEST) - 1, _LONGEST).to(kind)
        out = self.out(functional.relu(self.hidden(torch.cat([seen, left], 1)))).float()
        parts = out.unflatten(1, (-1, 2 + 2 * _VALUES))
        scales = _SMALLEST_SCALE + functional.softplus(parts[..., 2 + _VALUES :])
        return Proposals(parts[..., 0], parts[..., 1], parts[..., 2 : 2 + _VALUES], scales)
