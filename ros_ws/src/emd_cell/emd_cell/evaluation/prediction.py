"""How well a net foretells recorded manipulations, whatever a planner makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from emd_core.errors import InvalidInputError
from emd_planner.sequence_files import load_sequences
from emd_planner.validation import Validator, mean_grid
from emd_planner.weights import load_net

_ALL = 2**31


def judge_net(
    data: Sequence[Path], steps: Sequence[int], split: str = "all", weights: Path | None = None
) -> list[dict[str, Any]]:
    """Predict the outcome of every part of `steps` manipulations of recorded sequences.

    Args:
        data: Directories of our data sets or of the authors' npz.
        steps: Lengths of the parts.
        split: See `emd_core.sequence_split`.
        weights: Of the net; the shipped ones if None.

    Returns:
        A row for each length: `steps`, `n`, `relative` (the net's error over doing nothing's) and
        the means of `emd_planner.validation.Scores`.

    Raises:
        InvalidInputError: If the data cannot be read, or no sequence is long enough.
        ModelError: If the weights cannot be used.
    """
    sequences, net = load_sequences(data, split=split), load_net(weights)
    longest = int(sequences.lengths.max(initial=0))
    if not 1 <= min(steps) <= max(steps) <= longest:
        raise InvalidInputError(
            f"steps must be in 1..{longest}, the longest of the {len(sequences)} sequences of the "
            f"split '{split}', got {list(steps)}"
        )
    rows = []
    average = mean_grid(sequences, _ALL)
    for count in steps:
        validator = Validator(sequences, average, count, torch.device("cpu"), _ALL)
        scores = asdict(validator.scores(net))
        relative = scores["net"] / scores["do_nothing"]
        rows.append({"steps": count, "n": len(validator), "relative": relative, **scores})
    return rows
