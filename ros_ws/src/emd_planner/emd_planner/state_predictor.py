"""What every EMD net does: encode a state, manipulate its code, decode (paper, III-A)."""

from __future__ import annotations

from abc import ABC, abstractmethod

import torch
from torch import Tensor, nn

from emd_core.errors import InvalidInputError
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.proposal import Proposals


class StatePredictor(nn.Module, ABC):
    """Predicts the cloth's state after a sequence of manipulations.

    Attributes:
        config: The architecture.
        compute_type: Type in which layers are computed; weights are kept in float32. bfloat16 is
            several times faster on a CPU that has instructions for it.
    """

    def __init__(self, config: EmdNetConfig | SpatialNetConfig) -> None:
        """Keep the architecture."""
        super().__init__()
        self.config = config
        self.compute_type = torch.float32

    @abstractmethod
    def encode(self, grids: Tensor) -> Tensor:
        """Compress states: E(s) (III-A).

        Args:
            grids: Shape (B, X, Y, Z) or (B, 1, X, Y, Z), boolean or real, 0 empty to 1 occupied.

        Returns:
            Codes, shape (B, ...), float32.

        Raises:
            InvalidInputError: If the shape does not fit the net.
        """

    @abstractmethod
    def manipulate(self, codes: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the code after one manipulation: M(c, m) (III-A).

        Args:
            codes: Shape (B, ...).
            manipulations: x0 y0 x1 y1 dx dy in normalised units, finite, shape (B, 6).

        Returns:
            The shape of `codes`, float32.
        """

    @abstractmethod
    def decode_logits(self, codes: Tensor) -> Tensor:
        """Decode without the output's nonlinearity, shape (B, X, Y, Z), float32."""

    def propose(self, codes: Tensor, goals: Tensor, steps: Tensor) -> Proposals | None:
        """Guess which manipulation follows on the way to a goal (ours).

        Args:
            codes: Of the present states, shape (B, ...).
            goals: Of the wanted states, the same shape.
            steps: Manipulations that lead there, shape (B,), integer, from 1.

        Returns:
            A distribution for each row; None if the net makes no guesses.
        """
        return None

    def checked(self, grids: Tensor) -> Tensor:
        """Give grids (B, X, Y, Z) that fit the net.

        Raises:
            InvalidInputError: If the shape does not fit the net.
        """
        if grids.ndim == 5 and grids.shape[1] == 1:
            grids = grids[:, 0]
        if tuple(grids.shape[1:]) != self.config.grid_size:
            raise InvalidInputError(
                f"grids of shape (B, {', '.join(map(str, self.config.grid_size))}) were wanted, "
                f"got {tuple(grids.shape)}; voxelise with the net's field of view"
            )
        return grids

    def decode(self, codes: Tensor) -> Tensor:
        """Expand codes to real-valued states (B, X, Y, Z): D(c) (III-A)."""
        return self.output(self.decode_logits(codes))

    def output(self, logits: Tensor) -> Tensor:
        """Apply the output's nonlinearity to what `decode_logits` gives."""
        return logits.sigmoid() if self.config.output == "logistic" else logits

    def roll_out(self, codes: Tensor, manipulations: Tensor) -> list[Tensor]:
        """Apply the manipulation module recurrently (III-C, Fig. 3).

        Args:
            codes: Of the initial states, shape (B, ...).
            manipulations: Shape (B, n, 6), normalised units.

        Returns:
            The codes after each manipulation, n of the shape of `codes`.
        """
        predicted = []
        for step in range(manipulations.shape[1]):
            codes = self.manipulate(codes, manipulations[:, step])
            predicted.append(codes)
        return predicted

    def predict(self, grids: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the states after all manipulations: D(M(..M(E(s0), m0).., m_n-1)) (III-C).

        Args:
            grids: Initial states, shape (B, X, Y, Z).
            manipulations: Shape (B, n, 6), normalised units; n may be 0.

        Returns:
            Real-valued states, shape (B, X, Y, Z).
        """
        codes = self.encode(grids)
        return self.decode(([codes] + self.roll_out(codes, manipulations))[-1])

    def predict_all(self, grids: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the states after each manipulation, shape (B, n, X, Y, Z)."""
        codes = self.roll_out(self.encode(grids), manipulations)
        batch, steps = manipulations.shape[:2]
        if not codes:
            return grids.new_zeros(batch, 0, *self.config.grid_size, dtype=torch.float32)
        return self.decode(torch.stack(codes, 1).flatten(0, 1)).unflatten(0, (batch, steps))

    def forward(self, grids: Tensor, manipulations: Tensor) -> Tensor:
        """Do `predict`."""
        return self.predict(grids, manipulations)
