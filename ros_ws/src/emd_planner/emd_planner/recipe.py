"""How a batch changes the weights: AdamW on a weighted sum, or the Manhattan rule (eq. 3)."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn

from emd_planner.augmentation import Examples
from emd_planner.losses import consistency_loss, state_loss
from emd_planner.manhattan import Manhattan
from emd_planner.process_group import ProcessGroup
from emd_planner.state_predictor import StatePredictor
from emd_planner.training_config import TrainingConfig


class Losses:
    """The losses of one batch, scalars with gradients.

    Attributes:
        state: loss_s (eq. 1), mean over the windows and their steps.
        consistency: loss_c (eq. 2), likewise.
        reconstruction: Squared error of D(E(s)) against s, or 0 if it is not wanted.
        proposal: Negative log-likelihood of the windows' manipulations under the net's guesses
            for every earlier and later state of a window; 0 for a net without guesses.
    """

    def __init__(self, net: StatePredictor, examples: Examples, reconstruct: bool = False) -> None:
        """Run the net over windows on its own device."""
        grids, manipulations = examples.grids, examples.manipulations
        batch, steps = manipulations.shape[:2]
        codes = net.encode(grids.flatten(0, 1)).unflatten(0, (batch, steps + 1))
        predicted = torch.stack(net.roll_out(codes[:, 0], manipulations), dim=1)
        actual = grids.float()
        logits, wanted = net.decode_logits(predicted.flatten(0, 1)), actual[:, 1:].flatten(0, 1)
        self.state = state_loss(net.output(logits), wanted).mean()
        self._logits, self._wanted = logits, wanted
        self.consistency = consistency_loss(
            predicted.flatten(0, 1), codes[:, 1:].flatten(0, 1)
        ).mean()
        self.proposal = proposal_loss(net, codes.detach(), manipulations, examples.used)
        self.reconstruction = self.state.new_zeros(())
        if reconstruct:
            self.reconstruction = state_loss(net.decode(codes[:, 0]), actual[:, 0]).mean()

    @property
    def cross_entropy(self) -> Tensor:
        """Of the same predictions as `state`, mean over all voxels, for a logistic output."""
        return nn.functional.binary_cross_entropy_with_logits(self._logits, self._wanted)


def proposal_loss(
    net: StatePredictor, codes: Tensor, manipulations: Tensor, used: Tensor
) -> Tensor:
    """Mean negative log-likelihood of manipulations under the net's guesses, a scalar.

    Args:
        net: Makes the guesses, or none; then the loss is 0.
        codes: Of windows of states, shape (B, n+1, ...).
        manipulations: Shape (B, n, 6).
        used: Whether each hand grasped cloth, boolean, shape (B, n, 2).
    """
    pairs = torch.combinations(torch.arange(codes.shape[1], device=codes.device))
    start, end = pairs[:, 0], pairs[:, 1]
    steps = (end - start).expand(len(codes), -1)
    guesses = net.propose(
        codes[:, start].flatten(0, 1), codes[:, end].flatten(0, 1), steps.flatten()
    )
    if guesses is None:
        return codes.new_zeros(())
    used = used[:, start].flatten(0, 1)
    likelihood = guesses.log_likelihood(manipulations[:, start].flatten(0, 1), used)
    return -likelihood.sum() / used.any(1).sum().clamp_min(1)


class AdamWRecipe:
    """AdamW with warm-up and cosine decay on loss_s + w_c loss_c + w_r loss_r (ours)."""

    def __init__(self, net: nn.Module, config: TrainingConfig, group: ProcessGroup) -> None:
        """Keep the weights; vectors (biases) do not decay."""
        self.config, self.group = config, group
        self.parameters = [p for p in net.parameters() if p.requires_grad]
        matrices = [p for p in self.parameters if p.ndim > 1]
        vectors = [p for p in self.parameters if p.ndim <= 1]
        self.optimiser = torch.optim.AdamW(
            [
                {"params": matrices, "weight_decay": config.weight_decay},
                {"params": vectors, "weight_decay": 0.0},
            ],
            lr=config.learning_rate,
            betas=(0.9, 0.98),
            fused=True,
        )

    def step(self, losses: Losses, progress: float) -> None:
        """Change the weights; `progress` is the part of the run that is over, 0..1."""
        config = self.config
        state = losses.state if config.state_objective == "squared" else losses.cross_entropy
        total = state + config.consistency_weight * losses.consistency
        total = total + config.reconstruction_weight * losses.reconstruction
        total = total + config.proposal_weight * losses.proposal
        for group in self.optimiser.param_groups:
            group["lr"] = config.learning_rate * learning_rate_share(progress, config)
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()
        self.group.average([p.grad for p in self.parameters if p.grad is not None])
        nn.utils.clip_grad_norm_(self.parameters, config.gradient_clip)
        self.optimiser.step()

    def state_dict(self) -> dict[str, Any]:
        """Give what a checkpoint needs."""
        return self.optimiser.state_dict()

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take what `state_dict` gave."""
        self.optimiser.load_state_dict(state)


class ManhattanRecipe:
    """The paper's rule: the signs of the gradients of loss_s and loss_c, summed (eq. 3)."""

    def __init__(self, net: nn.Module, config: TrainingConfig, group: ProcessGroup) -> None:
        """Keep the weights."""
        self.optimiser = Manhattan(net.parameters(), config.learning_rate)
        self.group = group

    def step(self, losses: Losses, progress: float) -> None:
        """Change the weights; the learning rate is constant, so `progress` does not matter."""
        state = self.optimiser.gradients(losses.state, retain_graph=True)
        consistency = self.optimiser.gradients(losses.consistency)
        self.group.average([g for g in (*state, *consistency) if g is not None])
        self.optimiser.step(state, consistency)

    def state_dict(self) -> dict[str, Any]:
        """Give what a checkpoint needs."""
        return self.optimiser.state_dict()

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take what `state_dict` gave."""
        self.optimiser.load_state_dict(state)


def make_recipe(
    net: nn.Module, config: TrainingConfig, group: ProcessGroup | None = None
) -> AdamWRecipe | ManhattanRecipe:
    """Choose by `config.recipe`; gradients are averaged over the group's processes."""
    kind = ManhattanRecipe if config.recipe == "manhattan" else AdamWRecipe
    return kind(net, config, group or ProcessGroup())


def learning_rate_share(progress: float, config: TrainingConfig) -> float:
    """Give the learning rate over its peak: a linear warm-up, then half a cosine."""
    if progress < config.warm_up_share:
        return max(progress / config.warm_up_share, 0.01)
    fallen = (progress - config.warm_up_share) / (1.0 - config.warm_up_share)
    low = config.final_learning_rate_share
    return low + (1.0 - low) * 0.5 * (1.0 + math.cos(math.pi * min(fallen, 1.0)))
