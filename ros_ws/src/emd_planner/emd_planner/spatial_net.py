"""An EMD net whose code keeps the plane: maps over the desk instead of one vector (ours).

Encoder, manipulation module and decoder do what they do in the paper (III-A), and the planner uses
them alike. But a code is a stack of maps over x and y, so the net need not learn for every place
anew what a fold does. The manipulation module is told in maps where hands grasp and release, and
besides the cloth as it lies it sees it shifted by the displacement and reflected about each hand's
fold line, the perpendicular bisector of grasp and release, which is where folded cloth lies.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from emd_planner.convolution_blocks import (
    Dense,
    Double,
    Halve,
    Pointwise,
    Residual,
    channels_last,
    start_at_zero,
)
from emd_planner.net_config import SpatialNetConfig
from emd_planner.proposal import ProposalHead, Proposals
from emd_planner.state_predictor import StatePredictor

_LINE_SHARPNESS = 4.0  # of the maps that tell the sides of a fold line, per normalised length
_BUMP_WIDTHS = (0.08, 0.25)  # standard deviations of the maps that mark points, normalised
_MAPS_PER_HAND = 2 * len(_BUMP_WIDTHS) + 2


class SpatialEmdNet(StatePredictor):
    """Predicts the cloth's state after a sequence of manipulations; codes are (B, C, X/2, Y/2)."""

    config: SpatialNetConfig

    def __init__(self, config: SpatialNetConfig | None = None, seed: int = 0) -> None:
        """Make a net with initial weights drawn from `seed`."""
        super().__init__(config or SpatialNetConfig())
        x, y, layers = self.config.grid_size
        width = self.config.widths[0]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.encoder = nn.Sequential(Pointwise(4 * layers, width), Residual(width))
            self.manipulation = _ManipulationModule(self.config)
            last = Pointwise(width, 4 * layers)
            self.decoder = nn.Sequential(Residual(width), last)
            self.proposal: ProposalHead | None = None
            if self.config.proposals > 0:
                cells = (x // 2, y // 2)
                self.proposal = ProposalHead(width, cells, self.config)
        cast(Tensor, last.bias).data.fill_(self.config.output_bias)

    def encode(self, grids: Tensor) -> Tensor:
        """Compress states: E(s) (III-A); see `StatePredictor.encode`."""
        maps = self.checked(grids).to(self.compute_type).permute(0, 3, 1, 2)
        return self.encoder(functional.pixel_unshuffle(maps, 2)).float()

    def manipulate(self, codes: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the codes after one manipulation: M(c, m) (III-A)."""
        return self.manipulation(codes, manipulations, self.compute_type)

    def propose(self, codes: Tensor, goals: Tensor, steps: Tensor) -> Proposals | None:
        """Guess manipulations; see `StatePredictor.propose`."""
        if self.proposal is None:
            return None
        return self.proposal(codes, goals, steps, self.compute_type)

    def decode_logits(self, codes: Tensor) -> Tensor:
        """Decode without the output's nonlinearity, shape (B, X, Y, Z), float32."""
        maps = self.decoder(codes.to(self.compute_type))
        return functional.pixel_shuffle(maps, 2).permute(0, 2, 3, 1).float()


class _ManipulationModule(nn.Module):
    """What hands see and where they go, through convolutions, added to a code."""

    def __init__(self, config: SpatialNetConfig) -> None:
        super().__init__()
        fine, middle, coarse = config.widths
        self.touch = nn.Sequential(Dense(2 * fine + 3, middle), nn.ReLU(), Dense(middle, 2 * fine))
        self.moved = Pointwise(fine, config.moved_width)
        self.hand = Pointwise(config.moved_width + _MAPS_PER_HAND, fine)
        self.sheet = Pointwise(fine + config.moved_width, fine)
        self.first = Residual(fine)
        self.halved = nn.ModuleList([Halve(fine, middle), Halve(middle, coarse)])
        self.before = Residual(middle)
        self.middle = nn.Sequential(*(Residual(coarse) for _ in range(config.coarse_blocks)))
        self.doubled = nn.ModuleList([Double(coarse, middle), Double(middle, fine)])
        self.after = Residual(middle)
        self.last = Residual(fine)
        self.change = Pointwise(fine, fine)
        start_at_zero(self.change)

    def forward(self, codes: Tensor, manipulations: Tensor, kind: torch.dtype) -> Tensor:
        """Predict codes (B, C, H, W), float32, after manipulations (B, 6)."""
        maps = self._seen(codes.float(), manipulations, kind)
        fine = self.first(maps)
        middle = self.before(self.halved[0](fine))
        coarse = self.middle(self.halved[1](middle))
        middle = self.after(middle + self.doubled[0](coarse))
        fine = self.last(fine + self.doubled[1](middle))
        return codes + self.change(fine).float()

    def _seen(self, codes: Tensor, manipulations: Tensor, kind: torch.dtype) -> Tensor:
        """Lay the cloth beside what would become of it, and mark the hands."""
        batch, width = codes.shape[:2]
        grasps = manipulations[:, :4].unflatten(1, (2, 2))
        moves = manipulations[:, None, 4:]
        centres = _centres(codes)
        length = moves.square().sum(-1, keepdim=True).add(1e-6).sqrt()
        along = (moves / length)[:, :, None, None]
        # From each hand's fold line, wrapped: (B, 2, H, W, 2) and its part along the move.
        offset = _wrapped(centres - (grasps + 0.5 * moves)[:, :, None, None])
        beyond = (offset * along).sum(-1, keepdim=True)
        places = torch.cat(
            [
                (centres - moves[:, :, None, None]),
                centres - 2.0 * beyond * along,
            ],
            1,
        )
        parts = self.moved(channels_last(codes.to(kind))).float()
        shifted = _sample(parts, places.flatten(1, 2)).unflatten(2, (3, -1))
        touched = _sample(codes, grasps[:, :, None]).squeeze(-1).mT  # (B, 2, C)
        released = _sample(codes, (grasps + moves)[:, :, None]).squeeze(-1).mT
        told = torch.cat([touched, released, moves.expand(-1, 2, -1), length.expand(-1, 2, -1)], 2)
        gain, bias = self.touch(told.to(kind)).flatten(0, 1)[..., None, None].chunk(2, 1)
        marks = [*_marks(centres, grasps), *_marks(centres, grasps + moves)]
        across = (offset.square().sum(-1, keepdim=True) - beyond.square()).clamp_min(0.0)
        marks.append((_LINE_SHARPNESS * beyond[..., 0]).tanh())
        marks.append((-_LINE_SHARPNESS * across[..., 0]).exp())
        hands = torch.cat([shifted[:, :, 1:].transpose(1, 2), torch.stack(marks, 2)], 2)
        hands = self.hand(channels_last(hands.flatten(0, 1).to(kind)))
        hands = (hands * gain.sigmoid() + bias).unflatten(0, (batch, 2)).sum(1)
        sheet = torch.cat([codes, shifted[:, :, 0]], 1).to(kind)
        return self.sheet(channels_last(sheet)) + hands


def _centres(codes: Tensor) -> Tensor:
    """Normalised x and y of the cells of maps (B, C, H, W), shape (H, W, 2)."""
    axes = [
        (torch.arange(n, device=codes.device) + 0.5) * (2.0 / n) - 1.0 for n in codes.shape[2:]
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1)


def _wrapped(offsets: Tensor) -> Tensor:
    """Take the shortest way round: into [-1, 1)."""
    return (offsets + 1.0) % 2.0 - 1.0


def _marks(centres: Tensor, points: Tensor) -> list[Tensor]:
    """Bumps (B, H, X, Y) at points (B, H, 2), one for each width."""
    squared = _wrapped(centres - points[:, :, None, None]).square().sum(-1)
    return [(squared * (-0.5 / width**2)).exp() for width in _BUMP_WIDTHS]


def _sample(maps: Tensor, places: Tensor) -> Tensor:
    """Read periodic maps (B, C, X, Y) between cells at normalised places (B, N, M, 2)."""
    size = torch.tensor(maps.shape[2:], device=maps.device)
    padded = functional.pad(maps, (1, 1, 1, 1), mode="circular")
    cells = (places + 1.0) * (size / 2.0) % size  # 0..n, cell i has its centre at i + 0.5
    scaled = (cells + 1.0) * (2.0 / (size + 2)) - 1.0
    return functional.grid_sample(padded, scaled.flip(-1), align_corners=False)
