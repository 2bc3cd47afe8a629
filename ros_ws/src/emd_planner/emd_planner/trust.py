"""How likely a plan is to fail, learned from plans that were executed (ours).

The net's expected error is what the search lowers, so it is too good on the plans that are chosen,
the more the longer they are. A logistic regression on what the planner tells of a plan, fitted to
executed plans, turns it into the probability that the plan fails: that the outcome's voxel MSE is
more than `FAILED` of what doing nothing scores.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from emd_core.errors import InvalidInputError, ModelError
from emd_core.whole_file import write_text
from emd_planner.fold_plan import FoldPlan

# A plan has failed if its outcome scores more than this over doing nothing.
FAILED = 0.5
_LEAST = 1e-5  # MSE below which errors are not told apart: a sixth of a voxel
_PENALTY = 1e-2  # of squared weights, against one executed plan's log-likelihood


@dataclass(frozen=True)
class PlanFigures:
    """What a planner tells of a plan; errors are voxel MSE.

    Attributes:
        expected_error: See `FoldPlan`.
        initial_loss: Likewise.
        reconstruction_loss: Likewise.
        steps: Manipulations in the plan.
    """

    expected_error: float
    initial_loss: float
    reconstruction_loss: float
    steps: int

    @classmethod
    def of(cls, found: FoldPlan) -> PlanFigures:
        """Take them from a plan."""
        steps = len(found.manipulations)
        return cls(found.expected_error, found.initial_loss, found.reconstruction_loss, steps)

    def features(self) -> NDArray[np.float64]:
        """Give what the regression sees, shape (5,)."""
        initial = math.log(max(self.initial_loss, _LEAST))
        return np.array(
            [
                1.0,
                math.log(max(self.expected_error, _LEAST)) - initial,
                math.log(max(self.reconstruction_loss, _LEAST)) - initial,
                initial,
                self.steps - 1.0,
            ]
        )


@dataclass(frozen=True)
class TrustModel:
    """Logistic regression of failure.

    Attributes:
        weights: Of the features.
        plans: How many executed plans it was fitted to.
        failed: How many of them failed.
        command: What made it.
    """

    weights: tuple[float, ...]
    plans: int
    failed: int
    command: str = ""

    def failure_probability(self, figures: PlanFigures) -> float:
        """Give the probability, 0..1, that a plan with these figures fails when executed."""
        return float(expit(np.dot(self.weights, figures.features())))

    def save(self, weights: Path) -> None:
        """Write it beside a net's weights."""
        write_text(trust_file(weights), json.dumps(asdict(self), indent=1) + "\n")


def trust_file(weights: Path) -> Path:
    """Name the file of a net's trust model."""
    return weights.with_suffix(".trust.json")


def load_trust(weights: Path) -> TrustModel | None:
    """Read the trust model beside a net's weights; None if there is none.

    Raises:
        ModelError: If the file cannot be understood.
    """
    path = trust_file(weights)
    if not path.exists():
        return None
    try:
        stored = json.loads(path.read_text())
        model = TrustModel(**{**stored, "weights": tuple(map(float, stored["weights"]))})
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise ModelError(
            f"{path} should be a trust model: {err!r}; fit it anew with `./cell fit-trust`, or "
            "delete it"
        ) from err
    if len(model.weights) != len(PlanFigures(1.0, 1.0, 1.0, 1).features()):
        raise ModelError(f"{path} is of another version; fit it anew with `./cell fit-trust`")
    return model


def fit_trust(
    figures: Sequence[PlanFigures], failed: Sequence[bool], command: str = ""
) -> TrustModel:
    """Fit the regression to executed plans.

    Args:
        figures: Of each plan.
        failed: Whether its outcome scored more than `FAILED` of doing nothing.
        command: What the model shall name as its origin.

    Raises:
        InvalidInputError: If there are no plans of either kind.
    """
    outcome = np.array(failed, dtype=bool)
    if len(figures) != len(outcome) or outcome.all() or not outcome.any():
        raise InvalidInputError(
            f"trust needs executed plans of which some failed and some did not, got "
            f"{len(figures)} plans of which {int(outcome.sum())} failed; evaluate more sequences"
        )
    features = np.stack([item.features() for item in figures])
    signs = np.where(outcome, -1.0, 1.0)

    def loss(weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        margin = signs * (features @ weights)
        slope = signs * expit(margin)
        value = np.logaddexp(0.0, margin).sum() + _PENALTY * (weights**2).sum()
        return float(value), features.T @ slope + 2.0 * _PENALTY * weights

    found = minimize(loss, np.zeros(features.shape[1]), jac=True, method="L-BFGS-B")
    weights = tuple(float(value) for value in found.x)
    return TrustModel(weights, len(outcome), int(outcome.sum()), command)
