"""Every default of the planner, once; those of nets and training are in files of their own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from emd_core.errors import InvalidInputError

Polygon = tuple[tuple[float, float], ...]


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
        goal_cost: "squared": loss_s of the predicted probabilities, as in the paper. "expected":
            the mean squared error that is to be expected of the outcome if the probabilities are
            right, mean of p (1 - g) + (1 - p) g; it also counts what the net is unsure of (ours).
        halve_every: Iterations after which the worse half of the restarts ends, again and again;
            0: never (ours, successive halving).
        judged: How many of the best restarts are adjusted (`grasp_on_cloth`, `keep_in_reach`)
            before the cheapest is chosen (ours).
        patience: Iterations without improvement after which a search stops; 25 in the paper.
        eta_plus: Growth of a step whose gradient keeps its sign; 2.0 in the paper, 1.2 in Rprop.
        eta_minus: Shrinkage of a step whose gradient changed sign; 0.33 in the paper, 0.5 in
            Rprop.
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
        max_iterations=8,
        candidates=36,
        guessed_share=0.75,
        outline_folds=True,
        single_handed_share=0.5,
        goal_cost="expected",
        halve_every=3,
        judged=3,
        eta_plus=1.2,
        eta_minus=0.5,
        initial_step=0.03,
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
