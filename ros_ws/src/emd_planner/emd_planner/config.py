"""Every default of the network, its training and the planner, once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from emd_core.errors import InvalidInputError

Activation = Literal["tanh", "leaky_relu", "identity"]
Polygon = tuple[tuple[float, float], ...]


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


@dataclass(frozen=True)
class PlannerConfig:
    """Search for a manipulation sequence by back-propagation (paper, III-C).

    Attributes:
        restarts: Searches run side by side from different random starts; 10 in the paper.
        max_iterations: Most iterations of a search; 100 in the paper.
        candidates: Random starts that are rated by one prediction each; searches run from the
            best `restarts` of them; 0: from `restarts` random ones (ours).
        guessed_share: Share of the starts that are drawn from the net's guesses, if it makes any
            (ours).
        outline_folds: Whether folds along the cloth's outline begin further candidates,
            which go on as the net guesses (ours); see `emd_planner.outline_folds`.
        single_handed_share: Share of the random starts' steps in which the second hand starts
            off the cloth (ours).
        try_single_handed: Whether of the best starts such are rated, too, of which one hand is
            taken off the cloth in one step (ours).
        goal_cost: "squared": loss_s of the predicted probabilities, as in the paper. "expected":
            the mean squared error that is to be expected of the outcome if the probabilities are
            right, mean of p (1 - g) + (1 - p) g; it also counts what the net is unsure of (ours).
        halve_every: Iterations after which the worse half of the restarts ends, again and again;
            0: never (ours, successive halving).
        judged: How many of the best restarts are adjusted (`grasp_on_cloth`, `keep_in_reach`)
            before the cheapest is chosen (ours).
        patience: Iterations without improvement after which a search stops; 25 in the paper.
        eta_plus: Growth of a step whose gradient keeps its sign; 2.0 in the paper.
        eta_minus: Shrinkage of a step whose gradient changed sign; 0.33 in the paper.
        initial_step: First step of every value, normalised units (ours).
        min_step: Smallest step, normalised units (Riedmiller and Braun).
        max_step: Largest step, normalised units (ours: a quarter of the field of view).
        min_improvement: Decrease of the loss that counts as improvement.
        max_displacement: Largest magnitude of a displacement's x and y, normalised. The paper has
            1; its authors' public generator moves by up to 1.4, the cloth's side, and a half fold
            in one step needs that.
        time_budget: Seconds after which the best plan so far is taken; infinite: none.
        bfloat16: Search in bfloat16 where the processor multiplies it; gradients lose digits, of
            which iRprop- needs the signs only (ours).
        grasp_on_cloth: Move the grasp points of the first step onto the cloth that is seen (ours).
        keep_in_reach: Move grasp and release points into the arms' reach in the end (ours).
        start_on_cloth: Start the grasp points on the cloth (ours); else anywhere in [-1, 1], as
            the paper's "random initialisation" may be read. Off the cloth the net learned that
            nothing happens, so that there is no gradient to follow.
        max_steps: Longest plan that is tried when the number of steps is left open.
        step_margin: A shorter plan is taken if its loss is within this share of the best one's.
        grasp_tolerance_voxels: A grasp point this far off the silhouette is meant to grasp the
            cloth; the executor moves it to the hem, which it seeks within 0.06 m.
        threshold: Predicted value from which a voxel counts as occupied.
        grasp_weight: Weight beside loss_s of the distance from the cloth (normalised) in steps in
            which no hand grasps it (ours).
        reach_weight: Weight of the reach loss (normalised distance) beside loss_s (V-B).
        arms_may_cross: Whether the hand at larger y may go to the left arm (ours).
        silhouette_weight: Weight of the silhouettes' squared difference; 0: none (ours).
        hem_weight: Weight of the distance of grasps from the silhouette's edge, where a hem can
            be gripped; 0: none (ours).
        keep_out_weight: Weight of the depth of points and ways in the regions that `plan` is told
            to keep out of (ours).
        move_weight: Weight of the displacements' lengths; 0: none (ours).
        hands_apart_weight: Weight of what two hands lack of `hands_apart`; 0: none (ours).
        hands_apart: Least distance of two hands that grasp, metres.
    """

    restarts: int = 10
    max_iterations: int = 100
    candidates: int = 0
    guessed_share: float = 0.0
    outline_folds: bool = False
    single_handed_share: float = 0.0
    try_single_handed: bool = False
    goal_cost: Literal["squared", "expected"] = "squared"
    halve_every: int = 0
    judged: int = 1
    patience: int = 25
    eta_plus: float = 2.0
    eta_minus: float = 0.33
    initial_step: float = 0.05
    min_step: float = 1e-6
    max_step: float = 0.5
    min_improvement: float = 1e-6
    max_displacement: float = 1.4
    time_budget: float = math.inf
    bfloat16: bool = False
    grasp_on_cloth: bool = False
    keep_in_reach: bool = False
    start_on_cloth: bool = True
    max_steps: int = 3
    step_margin: float = 0.1
    grasp_tolerance_voxels: int = 2
    threshold: float = 0.5
    grasp_weight: float = 1.0
    reach_weight: float = 1.0
    arms_may_cross: bool = True
    silhouette_weight: float = 0.0
    hem_weight: float = 0.0
    keep_out_weight: float = 1.0
    move_weight: float = 0.0
    hands_apart_weight: float = 0.0
    hands_apart: float = 0.08

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        if self.goal_cost not in ("squared", "expected"):
            raise InvalidInputError(
                f"goal_cost must be 'squared' or 'expected', got {self.goal_cost!r}"
            )
        for name in ("restarts", "max_iterations", "max_steps", "judged"):
            if getattr(self, name) < 1:
                raise InvalidInputError(f"{name} must be 1 or more, got {getattr(self, name)}")
        for name in ("guessed_share", "single_handed_share", "threshold"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInputError(f"{name} must be in 0..1, got {getattr(self, name)}")
        weights = [name for name in vars(self) if name.endswith("_weight")]
        for name in ("candidates", "halve_every", "hands_apart", *weights):
            if not getattr(self, name) >= 0.0:
                raise InvalidInputError(f"{name} must be 0 or more, got {getattr(self, name)}")


# Planners by name. "paper" is III-C to the letter; "ours" starts from what the net guesses, counts
# what it is unsure of, and lets no step go by without a grasp.
PLANNERS: dict[str, PlannerConfig] = {
    "paper": PlannerConfig(max_displacement=1.0, start_on_cloth=False, grasp_weight=0.0),
    "ours": PlannerConfig(
        restarts=8,
        max_iterations=12,
        candidates=48,
        guessed_share=0.75,
        outline_folds=True,
        single_handed_share=0.5,
        try_single_handed=True,
        goal_cost="expected",
        halve_every=4,
        judged=3,
        bfloat16=True,
        grasp_on_cloth=True,
        keep_in_reach=True,
    ),
}


@dataclass(frozen=True)
class ReachConfig:
    """Where each hand may grasp and release: one convex polygon per arm (paper, V-B).

    The default is what HIRO's arms reach of the desk with a vertical hand that can also be raised
    to the lift height, as `emd_arm_executor.reach_region` computes it for the default cell (a test
    compares them). The left arm works mainly at y < 0, the right arm mainly at y > 0.

    Attributes:
        left: Corners (x, y) in either order, metres, table frame.
        right: The same for the right arm.
    """

    left: Polygon = (
        (0.18, -0.30),
        (0.21, 0.09),
        (0.21, 0.12),
        (0.18, 0.27),
        (0.15, 0.30),
        (0.06, 0.30),
        (-0.12, 0.12),
        (-0.15, 0.06),
        (-0.18, -0.03),
        (-0.18, -0.27),
        (-0.15, -0.30),
    )
    right: Polygon = (
        (0.18, 0.30),
        (0.21, -0.09),
        (0.21, -0.12),
        (0.18, -0.27),
        (0.15, -0.30),
        (0.06, -0.30),
        (-0.12, -0.12),
        (-0.15, -0.06),
        (-0.18, 0.03),
        (-0.18, 0.27),
        (-0.15, 0.30),
    )


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
