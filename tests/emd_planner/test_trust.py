"""Whether plans that fail are known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from emd_core.errors import InvalidInputError, ModelError
from emd_planner.trust import PlanFigures, TrustModel, fit_trust, load_trust, trust_file
from emd_planner.weights import SHIPPED_WEIGHTS


def _executed(count: int, seed: int) -> tuple[list[PlanFigures], list[bool], np.ndarray]:
    """Plans whose probability of failure is known: it grows with expected error and steps."""
    rng = np.random.default_rng(seed)
    initial = rng.uniform(0.03, 0.15, count)
    ratio = rng.uniform(0.1, 1.0, count)
    steps = rng.integers(1, 4, count)
    truth = 1.0 / (1.0 + np.exp(-(1.0 + 3.0 * np.log(ratio) + 0.5 * (steps - 1))))
    figures = [
        PlanFigures(float(r * i), float(i), 0.005, int(n))
        for r, i, n in zip(ratio, initial, steps, strict=True)
    ]
    return figures, list(rng.random(count) < truth), truth


def test_probabilities_are_those_with_which_plans_fail() -> None:
    """Fitted to 3000 plans, the model gives the true probability of others within 0.05."""
    model = fit_trust(*_executed(3000, 0)[:2])
    figures, _, truth = _executed(500, 1)
    found = np.array([model.failure_probability(item) for item in figures])
    assert np.abs(found - truth).mean() < 0.03
    assert np.abs(found - truth).max() < 0.1
    assert model.plans == 3000 and 0 < model.failed < 3000


def test_a_model_is_kept_beside_the_weights(tmp_path) -> None:
    """What is written is what is read; weights without one have none; nonsense is refused."""
    weights = tmp_path / "net.safetensors"
    assert load_trust(weights) is None
    model = fit_trust(*_executed(50, 0)[:2], command="by the tests")
    model.save(weights)
    assert load_trust(weights) == model
    for text in ("{", "{}", '{"weights": [1.0], "plans": 1, "failed": 0}'):
        trust_file(weights).write_text(text)
        with pytest.raises(ModelError, match="fit-trust"):
            load_trust(weights)


def test_plans_of_one_kind_teach_nothing() -> None:
    """Without failures, or without successes, there is nothing to fit."""
    figures = _executed(10, 0)[0]
    for failed in ([False] * 10, [True] * 10):
        with pytest.raises(InvalidInputError, match="some failed"):
            fit_trust(figures, failed)


def test_errors_of_zero_have_a_probability_too() -> None:
    """A goal that is reached already, reproduced without error."""
    model = TrustModel((0.0, 1.0, 1.0, 0.1, 0.1), 1, 0)
    assert 0.0 <= model.failure_probability(PlanFigures(0.0, 0.0, 0.0, 1)) <= 1.0


def test_the_shipped_weights_have_a_trust_model() -> None:
    """A plan that is expected to lead nowhere is doubted more than one to the goal."""
    model = load_trust(SHIPPED_WEIGHTS)
    assert model is not None and model.plans > model.failed > 0
    good, bad = (PlanFigures(error, 0.1, 0.001, 1) for error in (0.01, 0.09))
    assert model.failure_probability(good) < 0.2 < 0.5 < model.failure_probability(bad)
