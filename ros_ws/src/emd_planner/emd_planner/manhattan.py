"""The Manhattan update rule for two losses (paper, eq. 3)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor, nn

from emd_core.errors import InvalidInputError

Gradients = Sequence[Tensor | None]


class Manhattan:
    """Moves every weight by the learning rate times the sum of its two gradients' signs.

    The paper prints the change as +eta [sign(g_s) + sign(g_c)] and means a descent, so it is
    subtracted here. Where the signs agree the sum is two, as in eq. 3 (the text beside it says
    "by eta"); where they differ the weight stays. A weight that one loss does not depend on, such
    as the decoder's on loss_c, moves by eta.

    Attributes:
        parameters: The weights it moves.
        learning_rate: eta; 1e-5 in the paper.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], learning_rate: float) -> None:
        """Keep the weights.

        Raises:
            InvalidInputError: If the learning rate is not positive.
        """
        if not learning_rate > 0.0:
            raise InvalidInputError(f"the learning rate must be positive, got {learning_rate}")
        self.parameters = list(parameters)
        self.learning_rate = learning_rate

    @torch.no_grad()
    def step(self, state_gradients: Gradients, consistency_gradients: Gradients) -> None:
        """Take one step.

        Args:
            state_gradients: Of loss_s, one per weight, None where it does not depend on it.
            consistency_gradients: Of loss_c, likewise.

        Raises:
            InvalidInputError: If there is not one entry per weight.
        """
        wanted = len(self.parameters)
        if (len(state_gradients), len(consistency_gradients)) != (wanted, wanted):
            raise InvalidInputError(
                f"one gradient of each loss per weight is needed ({wanted}), got "
                f"{len(state_gradients)} and {len(consistency_gradients)}"
            )
        for index, parameter in enumerate(self.parameters):
            for gradient in (state_gradients[index], consistency_gradients[index]):
                if gradient is not None:
                    parameter.sub_(gradient.sign(), alpha=self.learning_rate)

    def gradients(self, loss: Tensor, retain_graph: bool = False) -> Gradients:
        """Differentiate a scalar loss for `step`; None where it does not depend on a weight."""
        return torch.autograd.grad(
            loss, self.parameters, retain_graph=retain_graph, allow_unused=True
        )

    def state_dict(self) -> dict[str, float]:
        """Give what a checkpoint needs: the rule has no memory but its learning rate."""
        return {"learning_rate": self.learning_rate}

    def load_state_dict(self, state: dict[str, float]) -> None:
        """Take what `state_dict` gave."""
        self.learning_rate = float(state["learning_rate"])
