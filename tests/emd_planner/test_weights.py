"""Weights on disk."""

from __future__ import annotations

import json

import pytest
import torch
from safetensors.torch import save_file

from emd_core.errors import ModelError
from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.weights import load_net, read_provenance, save_net


@pytest.fixture
def saved(tmp_path, small_config):
    """A net and the file that it was written to."""
    net = EmdNet(small_config, seed=5)
    path = tmp_path / "net.safetensors"
    save_net(net, path, {"seed": 5, "command": "test"}, net.state_dict())
    return net, path


def test_there_and_back_again(saved):
    """A loaded net has the config and, to half precision, the weights of the saved one."""
    net, path = saved
    loaded = load_net(path)
    assert loaded.config == net.config
    for name, value in net.state_dict().items():
        torch.testing.assert_close(loaded.state_dict()[name], value, rtol=1e-3, atol=1e-6)
    assert not any(parameter.requires_grad for parameter in loaded.parameters())
    assert not loaded.training


def test_origin_travels_with_the_weights(saved):
    """What the weights come from is in the file and in the JSON beside it."""
    _, path = saved
    assert read_provenance(path) == {"seed": 5, "command": "test"}
    beside = json.loads(path.with_suffix(".json").read_text())
    assert beside["command"] == "test"
    assert beside["config"]["map_counts"] == [1, 4, 8, 8, 16, 16, 32]
    assert sorted(file.name for file in path.parent.iterdir()) == [
        "net.json",
        "net.safetensors",
    ]


def test_the_papers_net_fits_in_45_megabytes(tmp_path):
    """19.0 million weights in half precision."""
    net = EmdNet(EmdNetConfig())
    save_net(net, tmp_path / "net.safetensors", {}, net.state_dict())
    assert (tmp_path / "net.safetensors").stat().st_size < 45e6


def test_missing_and_broken_files_are_refused(tmp_path):
    """A missing file and a file of another kind are named, with the remedy."""
    with pytest.raises(ModelError, match="cell train"):
        load_net(tmp_path / "absent.safetensors")
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"not weights")
    with pytest.raises(ModelError, match="should be a safetensors"):
        load_net(broken)
    with pytest.raises(ModelError):
        read_provenance(broken)


def _rewrite(path, change):
    from safetensors import safe_open

    with safe_open(path, framework="pt") as stored:
        metadata = stored.metadata()
        tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    change(tensors, metadata)
    save_file(tensors, path, metadata)


def test_wrong_weights_are_refused_by_name(saved):
    """A missing weight, a wrong shape and NaN are refused: which, wanted and got."""
    net, path = saved
    name = "encoder.layers.1.weight"

    _rewrite(path, lambda tensors, _: tensors.update({name: torch.zeros(3, 3, 3, 4, 9)}))
    with pytest.raises(ModelError, match=r"layers.1.weight.*\(3, 3, 3, 4, 8\).*4, 9\)"):
        load_net(path)
    _rewrite(
        path, lambda tensors, _: tensors.update({name: torch.full((3, 3, 3, 4, 8), torch.nan)})
    )
    with pytest.raises(ModelError, match="layers.1.weight is not finite"):
        load_net(path)
    _rewrite(path, lambda tensors, _: tensors.pop(name))
    with pytest.raises(ModelError, match=r"lacks the weights \['encoder.layers.1.weight'\]"):
        load_net(path)
    _rewrite(path, lambda _, metadata: metadata.update(config="{}"))
    with pytest.raises(ModelError):
        load_net(path)
    _rewrite(path, lambda _, metadata: metadata.pop("config"))
    with pytest.raises(ModelError, match="config"):
        load_net(path)


def test_shipped_weights_are_the_spatial_net():
    """The weights in the package load and have the default architecture, guesses and all."""
    net = load_net()
    assert net.config == SpatialNetConfig()
    codes = net.encode(torch.zeros(1, 32, 32, 16))
    assert net.propose(codes, codes, torch.ones(1, dtype=torch.long)) is not None
