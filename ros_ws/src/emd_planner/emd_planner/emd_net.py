"""The EMD net: a 3D convolutional auto-encoder with a manipulation module (paper, III-A)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import torch
from torch import Tensor, nn

from emd_core.errors import InvalidInputError
from emd_planner.config import Activation, EmdNetConfig
from emd_planner.periodic_convolution import PeriodicConvolution, PeriodicTransposedConvolution


class EmdNet(nn.Module):
    """Predicts the cloth's state after a sequence of manipulations.

    Encoder, decoder and manipulation module are as the paper gives them (III-A, Fig. 2): the
    defaults have 19.0 million weights. The paper leaves open, and `EmdNetConfig` decides: the
    activations (tanh), biases (yes, from 0) and the decoder's output (logistic).

    "10 layers" of the manipulation module are counted like the "6 layers" of the encoder, for
    which the paper lists 7 map counts: layers of weights.

    Attributes:
        config: The architecture.
        compute_type: Type in which layers are computed; weights are kept in float32. bfloat16 is
            several times faster on a CPU that has instructions for it.
    """

    def __init__(self, config: EmdNetConfig | None = None, seed: int = 0) -> None:
        """Make a net with initial weights drawn from `seed`."""
        super().__init__()
        self.config = config or EmdNetConfig()
        self.compute_type = torch.float32
        self.encoder = Encoder(self.config)
        self.manipulation = ManipulationModule(self.config)
        self.decoder = Decoder(self.config)
        generator = torch.Generator().manual_seed(seed)
        self.encoder.initialise(generator)
        self.manipulation.initialise(generator)
        self.decoder.initialise(generator)

    def encode(self, grids: Tensor) -> Tensor:
        """Compress states: E(s) (III-A).

        Args:
            grids: Shape (B, X, Y, Z) or (B, 1, X, Y, Z), boolean or real, 0 empty to 1 occupied.

        Returns:
            Codes, shape (B, C), float32.

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
        return self.encoder(grids.to(self.compute_type).unsqueeze(4)).flatten(1).float()

    def manipulate(self, codes: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the code after one manipulation: M(c, m) (III-A).

        Args:
            codes: Shape (B, C).
            manipulations: x0 y0 x1 y1 dx dy in normalised units, finite, shape (B, 6).

        Returns:
            Shape (B, C), float32.
        """
        return self.manipulation(codes, manipulations, self.compute_type)

    def decode_logits(self, codes: Tensor) -> Tensor:
        """Decode without the output's nonlinearity, shape (B, X, Y, Z), float32."""
        maps = codes.to(self.compute_type).view(codes.shape[0], 1, 1, 1, -1)
        return self.decoder(maps).squeeze(4).float()

    def decode(self, codes: Tensor) -> Tensor:
        """Expand codes (B, C) to real-valued states (B, X, Y, Z): D(c) (III-A)."""
        return self.output(self.decode_logits(codes))

    def output(self, logits: Tensor) -> Tensor:
        """Apply the output's nonlinearity to what `decode_logits` gives."""
        return logits.sigmoid() if self.config.output == "logistic" else logits

    def roll_out(self, codes: Tensor, manipulations: Tensor) -> list[Tensor]:
        """Apply the manipulation module recurrently (III-C, Fig. 3).

        Args:
            codes: Of the initial states, shape (B, C).
            manipulations: Shape (B, n, 6), normalised units.

        Returns:
            The codes after each manipulation, n of shape (B, C).
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


class Encoder(nn.Module):
    """Strided convolutions from maps (B, X, Y, Z, 1) to (B, 1, 1, 1, C)."""

    def __init__(self, config: EmdNetConfig) -> None:
        """Build the layers."""
        super().__init__()
        maps, sizes = config.map_counts, config.layer_sizes
        self.config = config
        self.layers = nn.ModuleList(
            PeriodicConvolution(maps[i], maps[i + 1], sizes[i], stride, config.biases)
            for i, stride in enumerate(config.strides)
        )

    def initialise(self, generator: torch.Generator) -> None:
        """Draw the weights uniformly (III-A)."""
        _initialise_convolutions(self.layers, self.config.convolution_init, generator)

    def forward(self, maps: Tensor) -> Tensor:
        """Encode."""
        for layer in self.layers[:-1]:
            maps = _activate(layer(maps), self.config.activation)
        return _activate(self.layers[-1](maps), self.config.code_activation)


class Decoder(nn.Module):
    """The encoder's layers transposed and in reverse, from (B, 1, 1, 1, C) to (B, X, Y, Z, 1)."""

    def __init__(self, config: EmdNetConfig) -> None:
        """Build the layers."""
        super().__init__()
        maps, sizes = config.map_counts, config.layer_sizes
        self.config = config
        self.layers = nn.ModuleList(
            PeriodicTransposedConvolution(
                maps[i + 1], maps[i], sizes[i], config.strides[i], config.biases
            )
            for i in reversed(range(len(config.strides)))
        )

    def initialise(self, generator: torch.Generator) -> None:
        """Draw the weights uniformly (III-A)."""
        _initialise_convolutions(self.layers, self.config.convolution_init, generator)
        if self.config.biases:
            nn.init.constant_(cast(Tensor, self.layers[-1].bias), self.config.output_bias)

    def forward(self, maps: Tensor) -> Tensor:
        """Decode, without the output's nonlinearity."""
        for layer in self.layers[:-1]:
            maps = _activate(layer(maps), self.config.activation)
        return self.layers[-1](maps)


class ManipulationModule(nn.Module):
    """Changes a code step by step, layer by layer, as the manipulation says (III-A, Fig. 2).

    Each layer sees a state section (copied from layer to layer with fixed weights of one, the
    layer's activations added), a manipulation section (the same six values at every layer) and,
    from the second layer on, a hidden section of regular neurons.
    """

    def __init__(self, config: EmdNetConfig) -> None:
        """Build the layers."""
        super().__init__()
        code, hidden = config.code_size, config.hidden_size
        last = config.manipulation_layers - 1
        self.config = config
        self.layers = nn.ModuleList(
            nn.Linear(
                code + config.manipulation_size + (hidden if i > 0 else 0),
                code + (hidden if i < last else 0),
                bias=config.biases,
            )
            for i in range(config.manipulation_layers)
        )

    @torch.no_grad()
    def initialise(self, generator: torch.Generator) -> None:
        """Draw the weights uniformly; those from manipulation inputs vary more (III-A)."""
        config = self.config
        start, end = config.code_size, config.code_size + config.manipulation_size
        for layer in cast(Iterable[nn.Linear], self.layers):
            bound, input_bound = config.manipulation_init, config.manipulation_input_init
            layer.weight.uniform_(-bound, bound, generator=generator)
            layer.weight[:, start:end].uniform_(-input_bound, input_bound, generator=generator)
            if config.biases:
                layer.bias.zero_()

    def forward(self, codes: Tensor, manipulations: Tensor, compute_type: torch.dtype) -> Tensor:
        """Predict codes (B, C) after manipulations (B, 6)."""
        size = self.config.code_size
        state = codes.float()  # sums of small changes need float32
        inputs = manipulations.to(compute_type)
        hidden = state.new_zeros(state.shape[0], 0, dtype=compute_type)
        for layer in cast(Iterable[nn.Linear], self.layers):
            sections = torch.cat([state.to(compute_type), inputs, hidden], 1)
            bias = None if layer.bias is None else layer.bias.to(compute_type)
            out = nn.functional.linear(sections, layer.weight.to(compute_type), bias)
            out = _activate(out, self.config.manipulation_activation)
            state, hidden = state + out[:, :size], out[:, size:]
        return state


def _activate(values: Tensor, activation: Activation) -> Tensor:
    if activation == "tanh":
        return values.tanh()
    return nn.functional.leaky_relu(values, 0.1) if activation == "leaky_relu" else values


@torch.no_grad()
def _initialise_convolutions(
    layers: nn.ModuleList, bound: float, generator: torch.Generator
) -> None:
    for layer in cast(Iterable[PeriodicConvolution], layers):
        layer.weight.uniform_(-bound, bound, generator=generator)
        if layer.bias is not None:
            layer.bias.zero_()
