"""Starts the simulated cell with our cloth on its table."""

from __future__ import annotations

import sys

from emd_arm_executor.ros.simulation_node import SimulationNode
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.warm_up import compile_kernels
from emd_core.ros.spin import spin_node


def make_node() -> SimulationNode:
    """Compile the cloth's solver, then make the node."""
    compile_kernels()
    return SimulationNode(lambda: Cloth(ClothConfig()))


def main() -> int:
    """Run the node until interrupted."""
    return spin_node(make_node)


if __name__ == "__main__":
    sys.exit(main())
