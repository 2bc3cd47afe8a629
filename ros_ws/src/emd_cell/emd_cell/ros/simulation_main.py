"""Starts the simulated cell with our cloth on its table."""

from __future__ import annotations

import sys

from emd_arm_executor.ros.simulation_node import SimulationNode
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.ros.spin import spin_node


def main() -> int:
    """Run the node until interrupted."""
    return spin_node(lambda: SimulationNode(lambda: Cloth(ClothConfig())))


if __name__ == "__main__":
    sys.exit(main())
