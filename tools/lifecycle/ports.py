"""Ports of this machine for robots and pages: the usual one, or the next that nobody has."""

import socket

from lira.hal.errors import ConfigError

MOST = 100
KINDS = {"TCP": socket.SOCK_STREAM, "UDP": socket.SOCK_DGRAM}


def taken(port: int) -> list[str]:
    """By which protocols nobody else may listen on a port of the loopback, since somebody does."""
    return [kind for kind in KINDS if not _is_free(port, kind)]


def free_from(first: int) -> int:
    """Return the first free port from one on. Raises `ConfigError` if there is none near."""
    for port in range(first, first + MOST):
        if not taken(port):
            return port
    raise ConfigError(f"no port from {first} to {first + MOST - 1} is free", "Choose one: --listen or --page-port.")


def _is_free(port: int, kind: str) -> bool:
    with socket.socket(socket.AF_INET, KINDS[kind]) as probe:
        if kind == "TCP":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
