"""Checkpoints of a training run, written whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from emd_core.errors import InvalidInputError
from emd_core.whole_file import whole_file


def save_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Write tensors and plain values so that a crash leaves the last checkpoint intact."""
    with whole_file(path) as temporary:
        torch.save(state, temporary)


def load_checkpoint(path: Path, identity: dict[str, Any]) -> dict[str, Any]:
    """Read a checkpoint of the run that `identity` describes.

    Args:
        path: What `save_checkpoint` wrote, with an entry "identity".
        identity: Configs, seed and data of the run that wants to go on.

    Raises:
        InvalidInputError: If the file is unreadable or belongs to another run.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        stored = dict(state["identity"])
    except Exception as err:  # the unpickler lets its own mishaps through
        raise InvalidInputError(
            f"{path} should be a training checkpoint: {err}; delete it to start anew"
        ) from err
    differing = [name for name in identity if stored.get(name) != identity[name]]
    if differing:
        raise InvalidInputError(
            f"{path} belongs to a run with another {', '.join(differing)}; give the same options "
            "to go on with it, or another --out to start anew"
        )
    return state
