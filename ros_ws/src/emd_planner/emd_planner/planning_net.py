"""A search's own copy of a net, with its weights in the type in which the search runs fastest."""

from __future__ import annotations

import copy
from weakref import WeakKeyDictionary

import torch

from emd_planner.state_predictor import StatePredictor

# What a copy was made of: bfloat16 asked for, and how often each parameter had been changed.
_Origin = tuple[bool, tuple[int, ...]]
_converted: WeakKeyDictionary[StatePredictor, tuple[_Origin, StatePredictor]] = WeakKeyDictionary()


def planning_copy(net: StatePredictor, bfloat16: bool) -> StatePredictor:
    """Copy a net, with weights and layers in bfloat16 if asked to and where that is faster.

    The weights' type and order in memory are converted once for a net, rather than for every plan
    or at every layer of every iteration. Copies share them and must not change them; hooks on the
    layers are each copy's own.
    """
    origin = (bfloat16, tuple(parameter._version for parameter in net.parameters()))
    known, converted = _converted.get(net, (None, net))
    if known != origin:
        converted = _convert(net, bfloat16)
        _converted[net] = (origin, converted)
    return copy.deepcopy(converted, {id(p): p for p in converted.parameters()})


def _convert(net: StatePredictor, bfloat16: bool) -> StatePredictor:
    copied = copy.deepcopy(net)
    for parameter in copied.parameters():
        if parameter.ndim == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
    if bfloat16 and multiplies_bfloat16(next(net.parameters()).device):
        copied = copied.to(torch.bfloat16)
        copied.compute_type = torch.bfloat16
    return copied


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for products in bfloat16."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())
