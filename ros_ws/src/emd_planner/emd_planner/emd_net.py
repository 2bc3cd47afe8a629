"""The EMD net: a 3D convolutional auto-encoder with a manipulation module (paper, III-A)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import torch
from torch import Tensor, nn

from emd_planner.net_config import Activation, EmdNetConfig
from emd_planner.periodic_convolution import PeriodicConvolution, PeriodicTransposedConvolution
from emd_planner.state_predictor import StatePredictor


class EmdNet(StatePredictor):
    """The paper's net; codes are vectors (B, C).

    Encoder, decoder and manipulation module are as the paper gives them (III-A, Fig. 2): the
    defaults have 19.0 million weights. The paper leaves open, and `EmdNetConfig` decides: the
    activations (leaky rectifiers), biases (yes, from 0) and the decoder's output (logistic).

    "10 layers" of the manipulation module are counted like the "6 layers" of the encoder, for
    which the paper lists 7 map counts: layers of weights.
    """

    config: EmdNetConfig

    def __init__(self, config: EmdNetConfig | None = None, seed: int = 0) -> None:
        """Make a net with initial weights drawn from `seed`."""
        super().__init__(config or EmdNetConfig())
        self.encoder = Encoder(self.config)
        self.manipulation = ManipulationModule(self.config)
        self.decoder = Decoder(self.config)
        generator = torch.Generator().manual_seed(seed)
        self.encoder.initialise(generator)
        self.manipulation.initialise(generator)
        self.decoder.initialise(generator)

    def encode(self, grids: Tensor) -> Tensor:
        """Compress states: E(s) (III-A); see `StatePredictor.encode`."""
        maps = self.checked(grids).to(self.compute_type).unsqueeze(4)
        return self.encoder(maps).flatten(1).float()

    def manipulate(self, codes: Tensor, manipulations: Tensor) -> Tensor:
        """Predict the codes after one manipulation: M(c, m) (III-A)."""
        return self.manipulation(codes, manipulations, self.compute_type)

    def decode_logits(self, codes: Tensor) -> Tensor:
        """Decode without the output's nonlinearity, shape (B, X, Y, Z), float32."""
        maps = codes.to(self.compute_type).view(codes.shape[0], 1, 1, 1, -1)
        return self.decoder(maps).squeeze(4).float()


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
