"""Where a bus is: HOST:PORT. Without zenoh, so that a command line can name the usual one at once."""

import re

from lira.hal.errors import ConfigError

DEFAULT_ROBOT = "rosbot"
DEFAULT_ENDPOINT = "127.0.0.1:7447"


def check_name(robot: str) -> None:
    """Raise `ConfigError` for a name that cannot be the first part of every key."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", robot):
        raise ConfigError(f"'{robot}' is no name for a robot", "Use letters, digits and underscores, as in ROS.")


def check_address(endpoint: str) -> None:
    """Raise `ConfigError` for what is not HOST:PORT."""
    match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9_.-]+):(\d{1,5})", endpoint)
    if match is None or not 0 < int(match[2]) < 65536:
        raise ConfigError(f"'{endpoint}' is no address", f"Write HOST:PORT, for example {DEFAULT_ENDPOINT}.")


def is_loopback(endpoint: str) -> bool:
    """Whether only this machine reaches it."""
    host = endpoint.rpartition(":")[0].strip("[]")
    return host == "localhost" or host == "::1" or host.startswith("127.")
