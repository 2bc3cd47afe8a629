"""How the console runs."""

from __future__ import annotations

from dataclasses import dataclass

from emd_core.errors import InvalidInputError


@dataclass(frozen=True)
class ConsoleConfig:
    """Settings of the console.

    Attributes:
        host: Address to listen on; anything but this machine's own needs `tokens`.
        port: TCP port to listen on.
        tokens: Whether visitors must show a token, of an operator or of a viewer.
        operator_token: The operator's; one is made if empty.
        viewer_token: The viewers'; one is made if empty.
        directory: Where examples and the log of commands are kept.
        reliable: Whether lost images are asked for again, which needs publishers that offer it.
        camera_rate: Pictures a second that a viewer is sent at most.
        restarts: Random initialisations of a search, as many as the folding loop takes; 0: the
            planner's default.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    tokens: bool = False
    operator_token: str = ""
    viewer_token: str = ""
    directory: str = "runs/console"
    reliable: bool = False
    camera_rate: float = 15.0
    restarts: int = 24

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If the port or the rate is out of range.
        """
        if not 0 < self.port < 65536:
            raise InvalidInputError(f"a port of 1..65535 is wanted, got {self.port}")
        if not 0 < self.camera_rate <= 60:
            raise InvalidInputError(
                f"camera_rate must be above 0 and at most 60, got {self.camera_rate}"
            )
