"""Recipes of training, by their numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class AugmentationConfig:
    """Random changes to training examples that keep them true (paper, III-B).

    Attributes:
        free_share: Share of windows that are turned by any angle and shifted by up to
            `free_shift`; this takes the points of the cloth, so the data must hold them.
        free_shift: Largest shift of these windows along x and y, normalised (ours).
        rotate: Turn the others by a random multiple of 90 degrees, which is exact on a grid.
        mirror: Mirror with probability one half.
        swap_grasps: Swap the two grasp points with probability one half.
        failure_probability: Share of windows with a step in which both hands grasp nothing; the
            paper says "in a randomly selected example", read here as one of a batch of 16.
        translation_voxels: Largest periodic shift along x and y in whole voxels (ours; 0: none).
        outside_margin_voxels: Points meant to be outside the cloth keep this distance from its
            silhouette where there is room.
        near_miss_share: Share of the points of unused hands that are tried just beside the cloth
            instead: at its silhouette's edge, and farther than `near_miss_clearance` from every
            point of it (ours; takes the points of the cloth).
        near_miss_clearance: Normalised; more than the reach of a closing hand in the data
            (0.026 for a cloth of 41 x 41 vertices).
    """

    free_share: float = 0.5
    free_shift: float = 0.1
    rotate: bool = True
    mirror: bool = True
    swap_grasps: bool = True
    failure_probability: float = 1.0 / 16.0
    translation_voxels: int = 0
    outside_margin_voxels: int = 1
    near_miss_share: float = 0.0
    near_miss_clearance: float = 0.03


@dataclass(frozen=True)
class TrainingConfig:
    """Recipe of a training run.

    The paper trains 1,500,000 batches of 16 with the Manhattan rule on a GPU for three days
    (III-B): `recipe="manhattan"`. The default is for minutes on a CPU: AdamW on a weighted sum of
    the same losses, with a warm-up and a cosine decay and averaged weights.

    Attributes:
        recipe: "adamw", or "manhattan" for eq. 3.
        batch_size: Windows in a batch; each holds `rollout_steps` manipulations.
        rollout_steps: Manipulations applied in a row in training; 1 in the paper. 2 also trains
            the recurrent use that the planner makes of the net (ours).
        learning_rate: Peak of the schedule (adamw), or eta of eq. 3 (manhattan: 1e-5).
        final_learning_rate_share: Last learning rate over the peak (adamw).
        warm_up_share: Part of the run in which the learning rate rises linearly (adamw).
        weight_decay: Of AdamW, on weight matrices only.
        state_objective: What is minimised for the predicted states: "squared", which is loss_s,
            or "cross_entropy" (adamw; ours), which has the same optimum for binary states and
            steeper gradients where a prediction is firm and wrong. loss_s is reported either way.
        consistency_weight: Weight of loss_c beside it (adamw).
        proposal_weight: Weight of the guessed manipulations' negative log-likelihood, for nets
            that make guesses (adamw; ours). Their part of the net learns from nothing else, and
            nothing else learns from them.
        reconstruction_weight: Weight of the auto-encoder loss D(E(s)) against s (ours; 0: none).
        gradient_clip: Largest norm of the gradient (adamw).
        average_decay: Decay of the moving average of the weights, which is what is validated and
            exported; 0 exports the weights themselves.
        bfloat16: Compute layers in bfloat16 where the device has instructions for its products;
            elsewhere it is much slower than float32.
        validation_share: Part of the sequences held out.
        validate_every: Seconds between validations.
        checkpoint_every: Seconds between checkpoints.
        augmentation: Random changes to the examples.
    """

    recipe: Literal["adamw", "manhattan"] = "adamw"
    batch_size: int = 32
    rollout_steps: int = 2
    learning_rate: float = 5e-4
    final_learning_rate_share: float = 0.01
    warm_up_share: float = 0.03
    weight_decay: float = 0.01
    state_objective: Literal["squared", "cross_entropy"] = "cross_entropy"
    consistency_weight: float = 0.1
    proposal_weight: float = 0.01
    reconstruction_weight: float = 0.0
    gradient_clip: float = 1.0
    average_decay: float = 0.998
    bfloat16: bool = True
    validation_share: float = 0.1
    validate_every: float = 300.0
    checkpoint_every: float = 120.0
    augmentation: AugmentationConfig = AugmentationConfig()


# What `--recipe` chooses from, each with the net that is its own; "paper" is III-B to the letter.
RECIPE_NETS = {"ours": "spatial", "paper": "emd"}


RECIPES: dict[str, TrainingConfig] = {
    "ours": TrainingConfig(),
    "paper": TrainingConfig(
        recipe="manhattan",
        batch_size=16,
        rollout_steps=1,
        learning_rate=1e-5,
        average_decay=0.0,
        bfloat16=False,
    ),
}
