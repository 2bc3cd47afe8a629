"""A copy of a net whose weights are in the type in which a search runs fastest."""

from __future__ import annotations

import copy

import torch

from emd_planner.state_predictor import StatePredictor


def in_bfloat16(net: StatePredictor) -> StatePredictor:
    """Copy a net with weights and layers in bfloat16; the net itself where that is no faster.

    The weights are converted once rather than at every layer of every iteration.
    """
    if not multiplies_bfloat16(next(net.parameters()).device):
        return net
    converted = copy.deepcopy(net).to(torch.bfloat16)
    converted.compute_type = torch.bfloat16
    return converted


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for products in bfloat16."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())
