"""The nets that can be trained, by name."""

from __future__ import annotations

from emd_planner.emd_net import EmdNet
from emd_planner.net_config import EmdNetConfig, SpatialNetConfig
from emd_planner.spatial_net import SpatialEmdNet
from emd_planner.state_predictor import StatePredictor

NetConfig = EmdNetConfig | SpatialNetConfig

# "emd" is the paper's (III-A), "spatial" keeps the plane in its codes.
ARCHITECTURES: dict[str, type[NetConfig]] = {"emd": EmdNetConfig, "spatial": SpatialNetConfig}


def make_net(config: NetConfig, seed: int = 0) -> StatePredictor:
    """Make a net with initial weights drawn from `seed`."""
    if isinstance(config, SpatialNetConfig):
        return SpatialEmdNet(config, seed)
    return EmdNet(config, seed)


def architecture_of(config: NetConfig) -> str:
    """Name an architecture: the inverse of `ARCHITECTURES`."""
    return "spatial" if isinstance(config, SpatialNetConfig) else "emd"
