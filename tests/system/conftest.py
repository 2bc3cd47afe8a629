"""A running cell in a ROS domain of its own."""

import os
import time
from collections.abc import Iterator

import pytest
import rclpy
from own_domain import own_domain

from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes
from emd_cell.ros.cell_client import CellClient


@pytest.fixture(scope="session", autouse=True)
def ros_domain() -> Iterator[int]:
    """No test hears another cell on this machine."""
    with own_domain() as number:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        yield number


@pytest.fixture(scope="session")
def launcher(ros_domain, tmp_path_factory) -> Iterator[Launcher]:
    """All nodes of the cell, in real time."""
    use_large_messages()
    nodes = cell_nodes(overview=False, real_time_factor=1.0)
    with Launcher(nodes, tmp_path_factory.mktemp("cell")) as started:
        yield started


@pytest.fixture(scope="session")
def client(launcher) -> Iterator[CellClient]:
    """A client of the cell, which is ready."""
    rclpy.init()
    node = CellClient(on_spin=launcher.require_alive)
    try:
        node.wait_for_cell(simulated=True)
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def fresh_cloth(client: CellClient) -> None:
    """The cloth lies flat and the arms are where they can see it."""
    client.reset_simulation()
    time.sleep(0.2)
