"""Trained weights on disk: safetensors in float16, with the architecture as metadata."""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from emd_core.errors import InvalidInputError, ModelError
from emd_planner.architectures import ARCHITECTURES, NetConfig, architecture_of, make_net
from emd_planner.state_predictor import StatePredictor

SHIPPED_WEIGHTS = Path(__file__).parent / "weights" / "emd_net.safetensors"
_REMEDY = "train a net with `./cell train` and give the path of its .safetensors"


def load_net(path: Path | None = None, device: torch.device | str = "cpu") -> StatePredictor:
    """Load a trained net, ready for planning: its weights take no gradients.

    Args:
        path: A file that `save_net` wrote; None for the weights that come with the package.
        device: Where the net shall live.

    Raises:
        ModelError: If the file is missing or unreadable, or a weight is missing, is not finite or
            has a wrong shape.
    """
    path = path or SHIPPED_WEIGHTS
    if not path.is_file():
        raise ModelError(f"the weights {path} should be a file, found none; {_REMEDY}")
    try:
        with safe_open(path, framework="pt") as stored:
            metadata = stored.metadata() or {}
            tensors = {name: stored.get_tensor(name).float() for name in stored.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as err:
        raise ModelError(f"{path} should be a safetensors file: {err}; {_REMEDY}") from err
    net = make_net(_config_from(metadata, path))
    _check(net, tensors, path)
    net.load_state_dict(tensors)
    return net.to(device).eval().requires_grad_(False)


def read_provenance(path: Path | None = None) -> dict[str, Any]:
    """Give what `save_net` was told of the weights' origin.

    Raises:
        ModelError: If the file cannot be read.
    """
    path = path or SHIPPED_WEIGHTS
    try:
        with safe_open(path, framework="pt") as stored:
            return json.loads((stored.metadata() or {}).get("provenance", "{}"))
    except (OSError, SafetensorError, json.JSONDecodeError) as err:
        raise ModelError(f"{path} should be a net's safetensors: {err}; {_REMEDY}") from err


def save_net(
    net: StatePredictor,
    path: Path,
    provenance: Mapping[str, Any],
    tensors: Mapping[str, torch.Tensor],
) -> None:
    """Write weights in float16, with the net's config and their origin, and a JSON beside them.

    Each file appears whole or not at all.

    Args:
        net: Gives the architecture.
        path: Ends in `.safetensors`; the JSON takes its place with the ending `.json`.
        provenance: Says where the weights come from; JSON types.
        tensors: The weights under the names of `net.state_dict()`, which is what is usually given.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    config = dataclasses.asdict(net.config)
    architecture = architecture_of(net.config)
    metadata = {
        "architecture": architecture,
        "config": json.dumps(config),
        "provenance": json.dumps(dict(provenance)),
    }
    half = {name: value.detach().cpu().half().contiguous() for name, value in tensors.items()}
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        save_file(half, temporary, metadata)
        beside = Path(folder) / "beside.json"
        beside.write_text(
            json.dumps({"architecture": architecture, "config": config, **provenance}, indent=2)
            + "\n"
        )
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
        os.replace(beside, path.with_suffix(".json"))


def _config_from(metadata: Mapping[str, str], path: Path) -> NetConfig:
    try:
        stored = json.loads(metadata["config"])
        kind = ARCHITECTURES[metadata.get("architecture", "emd")]
        return kind(**{name: _as_tuple(value) for name, value in stored.items()})
    except (KeyError, TypeError, ValueError, InvalidInputError) as err:
        raise ModelError(f"{path} does not say the net's config ({err!r}); {_REMEDY}") from err


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(part) for part in value) if isinstance(value, list) else value


def _check(net: StatePredictor, tensors: Mapping[str, torch.Tensor], path: Path) -> None:
    wanted = net.state_dict()
    if wanted.keys() != tensors.keys():
        missing = sorted(wanted.keys() - tensors.keys())
        surplus = sorted(tensors.keys() - wanted.keys())
        raise ModelError(f"{path} lacks the weights {missing} and has {surplus} more; {_REMEDY}")
    for name, value in wanted.items():
        if tensors[name].shape != value.shape:
            raise ModelError(
                f"{path}: the weight {name} should have shape {tuple(value.shape)}, got "
                f"{tuple(tensors[name].shape)}; {_REMEDY}"
            )
        if not tensors[name].isfinite().all():
            raise ModelError(f"{path}: the weight {name} is not finite; {_REMEDY}")
