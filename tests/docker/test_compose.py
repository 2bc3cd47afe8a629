"""The container files agree with the cell that they package."""

import re
from pathlib import Path

import pytest
import yaml

from emd_cell.nodes import cell_nodes, console_node

NODES = [*cell_nodes(), console_node()]
ROOT = Path(__file__).parents[2]
DOCKER = ROOT / "docker"


@pytest.fixture(scope="module")
def compose() -> dict:
    """The parsed compose file."""
    return yaml.safe_load((DOCKER / "compose.yaml").read_text())


def test_there_is_one_service_for_each_node(compose):
    """The services are the nodes and the console; each starts its own node and no other."""
    services = compose["services"]
    assert list(services) == [node.name for node in NODES]
    for name, service in services.items():
        assert service["command"][:3] == ["up", "--only", name]


def test_a_service_is_restarted_if_its_node_is(compose):
    """Compose restarts what the launcher would restart, and nothing else."""
    for node in NODES:
        assert (compose["services"][node.name]["restart"] != "no") == node.restart


def test_services_share_what_fast_dds_needs(compose):
    """All have one network and one shared memory, and discovery stays on the host."""
    for service in compose["services"].values():
        assert service["network_mode"] == service["ipc"] == "host"
        assert service["environment"]["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_native_image_has_the_system_libraries_of_the_bootstrap():
    """Every library that `./cell` asks of Debian is installed in the Jazzy image, too."""
    wanted = set(re.findall(r'"(lib[\w.-]+)": has_library', (ROOT / "cell").read_text()))
    assert wanted
    assert wanted <= set(
        re.findall(r"^ +(lib\S+) ", (DOCKER / "Dockerfile.jazzy").read_text(), re.M)
    )
