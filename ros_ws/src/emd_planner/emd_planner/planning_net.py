"""A search's own copy of a net, with its weights in the type in which the search runs fastest."""

from __future__ import annotations

import copy
from weakref import WeakKeyDictionary

import torch

from emd_planner.fixed_blocks import fix_residuals
from emd_planner.state_predictor import StatePredictor

# Copies by whether they are in bfloat16, each with how often each parameter had been changed.
_Converted = dict[bool, tuple[tuple[int, ...], StatePredictor]]
_converted: WeakKeyDictionary[StatePredictor, _Converted] = WeakKeyDictionary()


def planning_copy(net: StatePredictor, bfloat16: bool) -> StatePredictor:
    """Copy a net, with weights and layers in bfloat16 if asked to and where that is faster.

    In float32 on a CPU its residual blocks become fixed ones (`emd_planner.fixed_blocks`). A net
    is converted once, rather than for every plan or at every layer of every iteration. Copies
    share the weights and must not change them; hooks on the layers are each copy's own.
    """
    coarse = bfloat16 and multiplies_bfloat16(next(net.parameters()).device)
    changes = tuple(parameter._version for parameter in net.parameters())
    copies = _converted.setdefault(net, {})
    known, converted = copies.get(coarse, (None, net))
    if known != changes:
        converted = _convert(net, coarse)
        copies[coarse] = (changes, converted)
    return copy.deepcopy(converted, {id(p): p for p in converted.parameters()})


def _convert(net: StatePredictor, bfloat16: bool) -> StatePredictor:
    copied = copy.deepcopy(net)
    for parameter in copied.parameters():
        if parameter.ndim == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
    if bfloat16:
        copied = copied.to(torch.bfloat16)
        copied.compute_type = torch.bfloat16
    elif next(net.parameters()).device.type == "cpu":
        fix_residuals(copied)
    return copied


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for products in bfloat16."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())
