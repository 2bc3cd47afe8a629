"""What a net foretells, compared with what was recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from emd_cell.evaluation.prediction import judge_net
from emd_cloth_sim.generate import generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_core.errors import InvalidInputError


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four sequences of two manipulations."""
    folder = tmp_path_factory.mktemp("data")
    generate(GenerationConfig(sequences=4, steps=2, seed=3, vertices=(21, 21)), folder)
    return folder


def test_the_shipped_net_foretells_better_than_without_a_net(data: Path) -> None:
    """Every part of a sequence counts, and the net beats doing nothing and an empty grid."""
    one, two = judge_net([data], [1, 2])
    assert (one["n"], two["n"]) == (8, 4)
    for row in (one, two):
        assert row["relative"] == row["net"] / row["do_nothing"]
        assert row["net"] < min(row["do_nothing"], row["empty"])


@pytest.mark.parametrize("steps", [[3], [0, 1]])
def test_lengths_that_no_sequence_has_are_refused(data: Path, steps: list[int]) -> None:
    """The error tells what there is."""
    with pytest.raises(InvalidInputError, match=r"1\.\.2"):
        judge_net([data], steps)
