"""Which nodes make a cell, and with which parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from emd_cell.launcher import NodeSpec

RECORDER = "recorder"
CONSOLE = "console"


def cell_nodes(
    seed: int = 0, gui: bool = False, overview: bool = True, real_time_factor: float = 1.0
) -> list[NodeSpec]:
    """The simulated cell: robot and camera, perception, planner, executor.

    Args:
        seed: Of the camera's noise.
        gui: Whether the simulator opens its window.
        overview: Whether a second camera films the scene.
        real_time_factor: Simulated seconds a second at most; 0: as fast as possible.
    """
    sim_time: dict[str, Any] = {"use_sim_time": True}
    simulation = {
        "seed": seed,
        "gui": gui,
        "overview.enabled": overview,
        "real_time_factor": real_time_factor,
    }
    perception = {**sim_time, "node.max_rate": 1.0, "node.reliable": True}
    return [
        NodeSpec("simulation", "emd_cell.ros.simulation_main", simulation, restart=False),
        NodeSpec("perception", "emd_perception.ros.perception_node", perception),
        NodeSpec("planner", "emd_planner.ros.planner_node", sim_time),
        NodeSpec("arm_executor", "emd_arm_executor.ros.executor_node", sim_time),
    ]


def recorder_node(directory: Path) -> NodeSpec:
    """Records the camera and state topics into a bag that must not exist yet."""
    return NodeSpec(
        RECORDER,
        "emd_cell.ros.recorder_node",
        {"use_sim_time": True, "reliable": True, "directory": str(directory.resolve())},
        restart=False,
    )


def console_node(
    host: str = "127.0.0.1", port: int = 8765, tokens: bool = False, directory: Path | None = None
) -> NodeSpec:
    """The operator's console.

    Args:
        host: Address to listen on; anything but this machine's own needs `tokens`.
        port: TCP port.
        tokens: Whether visitors must show a token.
        directory: Where it records; its default if None.
    """
    parameters: dict[str, Any] = {"host": host, "port": port, "tokens": tokens, "reliable": True}
    if directory is not None:
        parameters["directory"] = str(directory)
    return NodeSpec(CONSOLE, "emd_console.ros.console_main", parameters)
