"""Choice of the device."""

from __future__ import annotations

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_planner.device import resolve_device


def test_auto_is_a_device_that_is_there():
    """`auto` gives CUDA where torch finds it, else the CPU; tensors can be made there."""
    device = resolve_device("auto")
    assert device.type == ("cuda" if torch.cuda.is_available() else "cpu")
    assert torch.zeros(1, device=device).device.type == device.type


def test_unknown_and_missing_devices_are_refused():
    """A wrong name, and a GPU that is not there, are said to be so."""
    with pytest.raises(InvalidInputError, match="auto, cpu or cuda"):
        resolve_device("abacus")
    if not torch.cuda.is_available():
        with pytest.raises(InvalidInputError, match="no GPU"):
            resolve_device("cuda")
