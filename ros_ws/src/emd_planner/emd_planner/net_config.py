"""Architectures of the nets, by their numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from emd_core.errors import InvalidInputError

Activation = Literal["tanh", "leaky_relu", "identity"]


@dataclass(frozen=True)
class EmdNetConfig:
    """Architecture of the EMD net; the defaults are those of the paper (III-A).

    What the paper leaves open is marked "ours". The net's input has `2 ** 5` voxels along x and y
    and the strides of the encoder fold it into one code without spatial structure.

    Attributes:
        grid_size: Voxels along x, y and z.
        map_counts: Maps of the encoder, input first; the decoder has them in reverse.
        strides: Strides of the encoder's layers along x, y and z; reversed in the decoder.
        manipulation_layers: Weight layers of the manipulation module, counted like the encoder's.
        hidden_size: Regular neurons in each hidden layer of the manipulation module.
        manipulation_size: Values of one manipulation: two grasp points and the displacement.
        activation: Of the hidden layers of encoder and decoder (ours).
        code_activation: Of the encoder's last layer (ours).
        manipulation_activation: Of the manipulation module (ours).
        output: Of the decoder (ours): a logistic keeps the prediction between empty and full.
        biases: Whether layers have biases (ours); they start at 0, but for the decoder's last.
        output_bias: Where the decoder's last bias starts (ours): -3 is the logit of 5 %, about
            the share of voxels that a cloth occupies.
        convolution_init: Half-width of the uniform initial weights of encoder and decoder.
        manipulation_init: The same for the manipulation module.
        manipulation_input_init: The same for the connections from the manipulation inputs.
    """

    grid_size: tuple[int, int, int] = (32, 32, 16)
    map_counts: tuple[int, ...] = (1, 32, 32, 64, 128, 256, 512)
    strides: tuple[tuple[int, int, int], ...] = ((2, 2, 1),) + ((2, 2, 2),) * 5
    manipulation_layers: int = 10
    hidden_size: int = 512
    manipulation_size: int = 6
    activation: Activation = "leaky_relu"
    code_activation: Activation = "leaky_relu"
    manipulation_activation: Activation = "leaky_relu"
    output: Literal["logistic", "identity"] = "logistic"
    biases: bool = True
    output_bias: float = -3.0
    convolution_init: float = 0.05
    manipulation_init: float = 0.001
    manipulation_input_init: float = 0.05

    def __post_init__(self) -> None:
        """Check that the layers fit each other.

        Raises:
            InvalidInputError: If counts disagree or the encoder does not end in 1 x 1 x 1.
        """
        if len(self.map_counts) != len(self.strides) + 1 or self.map_counts[0] != 1:
            raise InvalidInputError(
                "map_counts must start with 1 and be one longer than strides, got "
                f"{self.map_counts} and {len(self.strides)} strides"
            )
        if self.manipulation_layers < 2:
            raise InvalidInputError(
                f"manipulation_layers must be at least 2, got {self.manipulation_layers}"
            )
        if self.layer_sizes[-1] != (1, 1, 1):
            raise InvalidInputError(
                f"the encoder must end in 1 x 1 x 1 voxels, {self.strides} end in "
                f"{self.layer_sizes[-1]}; give more or larger strides"
            )

    @property
    def code_size(self) -> int:
        """Values of an encoded state, `n_c` in eq. 2."""
        return self.map_counts[-1]

    @property
    def layer_sizes(self) -> tuple[tuple[int, int, int], ...]:
        """Voxels along x, y and z before each layer of the encoder and after the last."""
        sizes = [self.grid_size]
        for stride in self.strides:
            x, y, z = (math.ceil(n / s) for n, s in zip(sizes[-1], stride, strict=True))
            sizes.append((x, y, z))
        return tuple(sizes)


@dataclass(frozen=True)
class SpatialNetConfig:
    """Architecture of the net whose codes are maps over the desk (`SpatialEmdNet`; ours).

    Attributes:
        grid_size: Voxels along x, y and z; x and y must be multiples of 8.
        widths: Maps at a half, a quarter and an eighth of the grid's resolution.
        moved_width: Maps that are shifted and reflected as hands move.
        coarse_blocks: Residual blocks at the coarsest of them.
        proposals: Distributions in the mixture that guesses manipulations; 0: none.
        proposal_widths: Maps of the part that guesses, at a half, a quarter and an eighth of the
            grid's resolution.
        proposal_blocks: Residual blocks of that part at each of them.
        proposal_hidden: Values from which the mixture is read.
        output: Of the decoder: see `EmdNetConfig`.
        output_bias: Where the decoder's last bias starts: see `EmdNetConfig`.
    """

    grid_size: tuple[int, int, int] = (32, 32, 16)
    widths: tuple[int, int, int] = (48, 96, 160)
    moved_width: int = 16
    coarse_blocks: int = 2
    proposals: int = 8
    proposal_widths: tuple[int, int, int] = (64, 96, 128)
    proposal_blocks: int = 1
    proposal_hidden: int = 512
    output: Literal["logistic"] = "logistic"
    output_bias: float = -3.0

    def __post_init__(self) -> None:
        """Check that the grid can be halved three times.

        Raises:
            InvalidInputError: If it cannot.
        """
        if any(count % 8 for count in self.grid_size[:2]):
            raise InvalidInputError(
                f"grid_size must be multiples of 8 along x and y, got {self.grid_size}"
            )
