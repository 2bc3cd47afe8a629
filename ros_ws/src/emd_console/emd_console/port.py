"""TCP ports to listen on."""

from __future__ import annotations

import socket

from emd_core.errors import InvalidInputError

_TRIED = 20


def require_free_port(host: str, port: int) -> None:
    """Complain if nothing can listen there.

    Raises:
        InvalidInputError: If the port is taken or the address is not this machine's.
    """
    try:
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except (OSError, OverflowError) as err:
        raise InvalidInputError(
            f"the console cannot listen on {host}:{port}: {err}; name another address or port"
        ) from err


def free_port(host: str, port: int) -> int:
    """Give `port`, or the next one above it that is free.

    Raises:
        InvalidInputError: If none of the next twenty is.
    """
    for candidate in range(port, port + _TRIED - 1):
        try:
            require_free_port(host, candidate)
        except InvalidInputError:
            continue
        return candidate
    require_free_port(host, port + _TRIED - 1)
    return port + _TRIED - 1
