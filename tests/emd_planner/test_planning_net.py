"""Copies of a net for searches."""

from __future__ import annotations

import gc

import torch

from emd_planner import planning_net
from emd_planner.planning_net import planning_copy
from emd_planner.spatial_net import SpatialEmdNet


def _outcome(net: SpatialEmdNet) -> torch.Tensor:
    with torch.no_grad():
        return net.predict(torch.ones(1, 32, 32, 16), torch.full((1, 1, 6), 0.3))


def test_copies_predict_alike_and_share_weights() -> None:
    """Two copies hold the same numbers once, and hooks on one are not on the other."""
    net = SpatialEmdNet(seed=1)
    first, second = (planning_copy(net, bfloat16=False) for _ in range(2))
    assert torch.allclose(_outcome(first), _outcome(net), atol=1e-5)
    places = [[p.data_ptr() for p in copy.parameters()] for copy in (first, second, net)]
    assert places[0] == places[1] and not set(places[0]) & set(places[2])
    asked: list[str] = []
    first.decoder.register_forward_pre_hook(lambda module, inputs: asked.append("first"))
    _outcome(second)
    assert not asked
    _outcome(first)
    assert asked == ["first"]


def test_a_net_that_has_learned_is_copied_anew() -> None:
    """After a change of its weights a copy predicts what the net does now."""
    net = SpatialEmdNet(seed=1)
    before = _outcome(planning_copy(net, bfloat16=False))
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.add_(0.05)
    after = _outcome(planning_copy(net, bfloat16=False))
    assert not torch.allclose(before, after, atol=1e-3)
    assert torch.allclose(after, _outcome(net), atol=1e-5)


def test_nothing_is_kept_of_a_net_that_is_gone() -> None:
    """The copy ends with its net."""
    gc.collect()
    known = len(planning_net._converted)
    net = SpatialEmdNet(seed=1)
    planning_copy(net, bfloat16=False)
    assert len(planning_net._converted) == known + 1
    del net
    gc.collect()
    assert len(planning_net._converted) == known
