"""`./cell console`: the operator's page for any running cell."""

from __future__ import annotations

from pathlib import Path

from emd_cell.large_messages import use_large_messages
from emd_console.access import is_loopback
from emd_console.port import free_port
from emd_console.ros.console_main import main


def run_console(listen: str, port: int, tokens: bool, directory: Path, reliable: bool) -> int:
    """Serve the console until Ctrl-C; gives the exit status.

    Args:
        listen: Address; anything but this machine's own asks for tokens.
        port: TCP port, or the next free one.
        tokens: Whether to ask for tokens on this machine, too.
        directory: Of recordings and the log of commands.
        reliable: Whether lost images are asked for again, which publishers must offer.

    Raises:
        InvalidInputError: If nothing can listen there.
    """
    parameters = {
        "host": f"'{listen}'",
        "port": free_port(listen, port),
        "tokens": str(tokens or not is_loopback(listen)).lower(),
        "directory": f"'{directory}'",
        "reliable": str(reliable).lower(),
    }
    use_large_messages()
    arguments = ["--ros-args"]
    for name, value in parameters.items():
        arguments += ["-p", f"{name}:={value}"]
    return main(arguments)
