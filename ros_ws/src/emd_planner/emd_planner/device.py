"""Choice of the device on which the net runs."""

from __future__ import annotations

import torch

from emd_core.errors import InvalidInputError


def resolve_device(name: str) -> torch.device:
    """Turn "auto" into a CUDA device where there is one, else the CPU; take others as they are.

    Raises:
        InvalidInputError: If torch does not know the name or the machine has no such device.
    """
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
    except RuntimeError as err:
        raise InvalidInputError(f"the device must be auto, cpu or cuda, got {name!r}") from err
    if device.type == "cuda" and not torch.cuda.is_available():
        raise InvalidInputError(f"{name} was asked for and torch finds no GPU; use auto or cpu")
    return device
