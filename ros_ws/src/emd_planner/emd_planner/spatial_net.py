"""An EMD net whose code keeps the plane: maps over the desk instead of one vector (ours).

Encoder, manipulation module and decoder do what they do in the paper (III-A), and the planner uses
them alike. But a code is a stack of maps over x and y, so the net need not learn for every place
anew what a fold does. The manipulation module is told in maps where hands grasp and release, and
besides the cloth as it lies it sees it shifted by the displacement and reflected about each hand's
fold line, the perpendicular bisector of grasp and release, which is where folded cloth lies.
"""

from __future__ import annotations

from dataclasses import dataclass
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
    periodic_rim,
    start_at_zero,
)
from emd_planner.net_config import SpatialNetConfig
from emd_planner.proposal import ProposalHead, Proposals
from emd_planner.silhouette import column_centres
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
        width, cells = self.config.widths[0], (x // 2, y // 2)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.encoder = nn.Sequential(Pointwise(4 * layers, width), Residual(width, cells))
            self.manipulation = _ManipulationModule(self.config)
            last = Pointwise(width, 4 * layers)
            self.decoder = nn.Sequential(Residual(width, cells), last)
            self.proposal: ProposalHead | None = None
            if self.config.proposals > 0:
                self.proposal = ProposalHead(width, cells, self.config)
        cast(Tensor, last.bias).data.fill_(self.config.output_bias)

    def encode(self, grids: Tensor) -> Tensor:
        """Compress states: E(s) (III-A); see `StatePredictor.encode`."""
        maps = self.checked(grids).to(self.compute_type).permute(0, 3, 1, 2)
        return self.encoder(functional.pixel_unshuffle(maps, 2)).float()

    def manipulate(self, codes: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the codes after one manipulation: M(c, m) (III-A)."""
        hands = _hands(manipulations, (codes.shape[2], codes.shape[3]))
        return self.manipulation(codes, hands, self.compute_type)

    def roll_out(self, codes: Tensor, manipulations: Tensor) -> list[Tensor]:
        """Apply the manipulation module recurrently; see `StatePredictor.roll_out`."""
        predicted: list[Tensor] = []
        steps = manipulations.shape[1]
        if steps == 0:
            return predicted
        cells = (codes.shape[2], codes.shape[3])
        for hands in _hands(manipulations.transpose(0, 1).flatten(0, 1), cells).split(steps):
            codes = self.manipulation(codes, hands, self.compute_type)
            predicted.append(codes)
        return predicted

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
        x, y, _ = config.grid_size
        half, quarter, eighth = ((x // n, y // n) for n in (2, 4, 8))
        self.touch = nn.Sequential(Dense(2 * fine + 3, middle), nn.ReLU(), Dense(middle, 2 * fine))
        self.moved = Pointwise(fine, config.moved_width)
        self.hand = Pointwise(config.moved_width + _MAPS_PER_HAND, fine)
        self.sheet = Pointwise(fine + config.moved_width, fine)
        self.first = Residual(fine, half)
        self.halved = nn.ModuleList([Halve(fine, middle), Halve(middle, coarse)])
        self.before = Residual(middle, quarter)
        self.middle = nn.Sequential(
            *(Residual(coarse, eighth) for _ in range(config.coarse_blocks))
        )
        self.doubled = nn.ModuleList([Double(coarse, middle), Double(middle, fine)])
        self.after = Residual(middle, quarter)
        self.last = Residual(fine, half)
        self.change = Pointwise(fine, fine)
        start_at_zero(self.change)

    def forward(self, codes: Tensor, hands: _Hands, kind: torch.dtype) -> Tensor:
        """Predict codes (B, C, H, W), float32, after a manipulation of each."""
        maps = self._seen(codes.float(), hands, kind)
        fine = self.first(maps)
        middle = self.before(self.halved[0](fine))
        coarse = self.middle(self.halved[1](middle))
        middle = self.after(middle + self.doubled[0](coarse))
        fine = self.last(fine + self.doubled[1](middle))
        return codes + self.change(fine).float()

    def _seen(self, codes: Tensor, hands: _Hands, kind: torch.dtype) -> Tensor:
        """Lay the cloth beside what would become of it, and mark the hands."""
        batch, width, x, y = codes.shape
        parts = self.moved(channels_last(codes.to(kind))).float()
        moved = _sample(parts, hands.origins).unflatten(2, (3, -1))
        told = _sample(codes, hands.points).squeeze(2).mT  # (B, 4, C), of a hand grasp and release
        told = torch.cat([told.reshape(batch, 2, 2 * width), hands.moves], 2)
        gain, bias = self.touch(told.to(kind)).flatten(0, 1)[..., None, None].chunk(2, 1)
        seen = torch.cat([moved[:, :, 1:].transpose(1, 2), hands.marks], 2).flatten(0, 1)
        felt = self.hand(channels_last(seen.to(kind)))
        felt = (felt * gain.sigmoid() + bias).unflatten(0, (batch, 2)).sum(1)
        sheet = torch.cat([codes, moved[:, :, 0]], 1).to(kind)
        return self.sheet(channels_last(sheet)) + felt


@dataclass(frozen=True)
class _Hands:
    """What manipulations are on maps of H x W cells, whatever the cloth.

    Attributes:
        origins: Where the cloth of a cell would come from if all moved, and if it were folded by
            either hand, for `_sample`, shape (B, 3 * H, W, 2).
        points: Grasp and release of the first hand, then of the second, for `_sample`, shape
            (B, 1, 4, 2).
        marks: Maps that mark the points and each hand's fold line, shape (B, 2, M, H, W).
        moves: Displacement and its length for each hand, shape (B, 2, 3).
    """

    origins: Tensor
    points: Tensor
    marks: Tensor
    moves: Tensor

    def split(self, steps: int) -> list[_Hands]:
        """Part the hands of sequences, B = steps * sequences, into those of each step."""
        parts = (self.origins, self.points, self.marks, self.moves)
        return [_Hands(*step) for step in zip(*(part.chunk(steps) for part in parts), strict=True)]


def _hands(manipulations: Tensor, cells: tuple[int, int]) -> _Hands:
    """Draw manipulations (B, 6) on maps of `cells`."""
    axes = [column_centres(count, manipulations.device) for count in cells]
    grasps = manipulations[:, :4].unflatten(1, (2, 2))
    move = manipulations[:, 4:]
    length = move.square().sum(-1, keepdim=True).add(1e-6).sqrt()
    along = move / length
    points = torch.stack([grasps, grasps + move[:, None]], 2).flatten(1, 2)  # (B, 4, 2)
    # From each hand's fold line, wrapped, along x and along y, then along the move: (B, 2, H, W).
    middle = grasps + 0.5 * move[:, None]
    x, y = (_wrapped(axes[i] - middle[..., i, None]) for i in range(2))
    beyond = (x * along[:, None, :1])[..., :, None] + (y * along[:, None, 1:])[..., None, :]
    squared = x.square()[..., :, None] + y.square()[..., None, :]
    across = (squared - beyond.square()).clamp_min(0.0)
    centres = torch.stack(torch.meshgrid(*axes, indexing="ij"), -1)
    folded = centres - 2.0 * beyond[..., None] * along[:, None, None, None]
    shifted = centres - move[:, None, None, None]
    marks = torch.cat(
        [
            _marks(axes, points).unflatten(1, (2, -1)),
            torch.stack([(_LINE_SHARPNESS * beyond).tanh(), (-_LINE_SHARPNESS * across).exp()], 2),
        ],
        2,
    )
    told = torch.cat([move, length], 1)[:, None].expand(-1, 2, -1)
    origins = torch.cat([shifted, folded], 1).flatten(1, 2)
    return _Hands(_on_rim(origins, cells), _on_rim(points[:, None], cells), marks, told)


def _wrapped(offsets: Tensor) -> Tensor:
    """Take the shortest way round: into [-1, 1)."""
    return (offsets + 1.0) % 2.0 - 1.0


def _marks(axes: list[Tensor], points: Tensor) -> Tensor:
    """Bumps (B, P * K, H, W) at points (B, P, 2), one for each of K widths."""
    sharpness = torch.tensor([-0.5 / width**2 for width in _BUMP_WIDTHS], device=points.device)
    x, y = (
        (_wrapped(axis - points[..., i, None]).square()[..., None, :] * sharpness[:, None]).exp()
        for i, axis in enumerate(axes)
    )
    return (x[..., :, None] * y[..., None, :]).flatten(1, 2)


def _on_rim(places: Tensor, cells: tuple[int, int]) -> Tensor:
    """Give normalised places (..., 2) as `_sample` wants them."""
    size = torch.tensor(cells, device=places.device)
    numbered = (places + 1.0) * (size / 2.0) % size  # 0..n, cell i has its centre at i + 0.5
    return ((numbered + 1.0) * (2.0 / (size + 2)) - 1.0).flip(-1)


def _sample(maps: Tensor, places: Tensor) -> Tensor:
    """Read periodic maps (B, C, X, Y) between cells at places (B, N, M, 2) of `_on_rim`."""
    return functional.grid_sample(periodic_rim(maps), places, align_corners=False)
