"""Weights between those of a net and those of the same net trained on (Wortsman et al., 2022).

On little new data a net soon learns these by heart. Half-way back to where it started from, it
keeps most of what it has learned and predicts unseen sequences better than either end.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_planner.weights import load_net, read_provenance, save_net


def average_weights(before: Path, after: Path, share: float, out: Path) -> list[str]:
    """Write a net of the first one's architecture with weights between the two.

    Args:
        before: The net that training started from.
        after: What it became.
        share: Of the second one, 0..1.
        out: Gets the weights, `.safetensors`, with a JSON beside them.

    Returns:
        Parts of the net (encoder, ...) of which a weight has no counterpart of its shape in the
        second net; they are taken whole from the first.

    Raises:
        InvalidInputError: If the share is out of range or no part fits.
        ModelError: If a net cannot be read.
    """
    if not 0.0 <= share <= 1.0:
        raise InvalidInputError(f"share must be in 0..1, got {share}")
    net, other = load_net(before), load_net(after).state_dict()
    own = net.state_dict()
    kept = sorted({_part(name) for name, weight in own.items() if not _fits(weight, other, name)})
    mixed = {
        name: weight if _part(name) in kept else torch.lerp(weight, other[name], share)
        for name, weight in own.items()
    }
    if kept == sorted({_part(name) for name in own}):
        raise InvalidInputError(f"no part of {after} fits {before}; average nets of one kind")
    provenance = {
        "averaged": {"share_of_after": share, "taken_from_before": kept},
        "before": read_provenance(before),
        "after": read_provenance(after),
    }
    save_net(net, out, provenance, mixed)
    return kept


def _part(name: str) -> str:
    """Name the part of the net that a weight belongs to."""
    return name.split(".")[0]


def _fits(weight: Tensor, other: Mapping[str, Tensor], name: str) -> bool:
    return name in other and other[name].shape == weight.shape
