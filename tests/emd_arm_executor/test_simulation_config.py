"""Parameters with which a simulated cell cannot run are refused."""

from __future__ import annotations

import pytest

from emd_arm_executor.ros.simulation_config import OverviewConfig, SimulationConfig
from emd_core.errors import InvalidInputError


@pytest.mark.parametrize(
    "wrong",
    [
        {"step": 0.0},
        {"step": float("nan")},
        {"camera_rate": -1.0},
        {"truth_rate": float("inf")},
        {"real_time_factor": -0.5},
        {"seed": -1},
    ],
)
def test_values_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    """The error names the parameter and its range."""
    with pytest.raises(InvalidInputError, match=rf"SimulationConfig\.{next(iter(wrong))} must"):
        SimulationConfig(**wrong)  # type: ignore[arg-type]


def test_a_film_needs_a_rate_that_is_not_negative() -> None:
    """No pictures at all is a rate, too."""
    assert OverviewConfig(rate=0.0).rate == 0.0
    with pytest.raises(InvalidInputError, match="rate"):
        OverviewConfig(rate=-1.0)
