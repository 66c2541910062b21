"""Keys: what a bus needs to be encrypted and mutually authenticated. Made by `lira keys`; here they are only read.

A bundle is a folder of one peer: `ca.pem` (whom it trusts), `cert.pem`, `key.pem` (0600) and `name.txt` (the name on
its certificate). The robot's holds `roles.txt` besides: who is enrolled, and as what, one a line. Certificates are
trusted one by one: at the robot `ca.pem` holds an authority for each peer that is enrolled, at a peer that of the robot
alone. So nobody but the robot is taken for it, and who is revoked does not get through the handshake.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from lira.hal.errors import ConfigError

VARIABLE = "LIRA_KEYS"
CA, CERTIFICATE, KEY, NAME, ROLES = "ca.pem", "cert.pem", "key.pem", "name.txt", "roles.txt"
KEY_MODE = 0o600
NAMES = re.compile(r"[A-Za-z0-9_-]{1,40}")  # they are parts of keys
LONGEST_BYTES = 1 << 20


class Role(StrEnum):
    """What a peer may do at the robot."""

    VIEWER = "viewer"  # looks, and presses the emergency stop
    OPERATOR = "operator"  # drives in its own name, releases, resets
    BRIDGE = "bridge"  # a ROS bridge: drives on the plain topics, which carry no name


@dataclass(frozen=True, slots=True)
class Keys:
    """One peer's bundle. `roles` is the robot's list of who is enrolled, None for everybody else.

    `version` tells two states of one folder apart.
    """

    folder: Path
    name: str
    roles: Mapping[str, Role] | None
    version: tuple[Any, ...]

    def link_config(self) -> dict[str, Any]:
        """Return the session's settings for TLS both ways."""
        paths = {name: str(self.folder / name) for name in (CA, CERTIFICATE, KEY)}
        return {
            "root_ca_certificate": paths[CA],
            "listen_certificate": paths[CERTIFICATE],
            "listen_private_key": paths[KEY],
            "connect_certificate": paths[CERTIFICATE],
            "connect_private_key": paths[KEY],
            "enable_mtls": True,
            # A robot's address changes; that it is the robot is seen by whose authority signed its certificate.
            "verify_name_on_connect": False,
            "close_link_on_expiration": True,
        }

    def changed(self) -> bool:
        """Whether the folder holds something else by now."""
        return _version(self.folder) != self.version


def keys_from_environment() -> Keys | None:
    """Load the bundle that LIRA_KEYS names; None without one. Raises `ConfigError`."""
    folder = os.environ.get(VARIABLE)
    return load_keys(Path(folder)) if folder else None


def load_keys(folder: Path) -> Keys:
    """Load a bundle. Raises `ConfigError` if a file is missing or bad, or the key may be read by others."""
    folder = folder.resolve()
    version = _version(folder)
    for name in (CA, CERTIFICATE, KEY, NAME):
        if not (folder / name).is_file():
            raise ConfigError(f"{folder} holds no keys: {name} is missing", f"Make some with: lira keys init {folder}")
    if (folder / KEY).stat().st_mode & 0o077:
        raise ConfigError(f"others may read {folder / KEY}", f"Close it with: chmod 600 {folder / KEY}")
    name = _read(folder / NAME).strip()
    if NAMES.fullmatch(name) is None:
        raise ConfigError(f"{folder / NAME} holds no name", "Copy the bundle again from where it was made.")
    return Keys(folder, name, load_roles(folder), version)


def load_roles(folder: Path) -> dict[str, Role] | None:
    """Read who is enrolled from a robot's bundle; None from any other. Raises `ConfigError`."""
    path = folder / ROLES
    if not path.exists():
        return None
    roles = {}
    for line in _read(path).splitlines():
        name, _, role = line.partition(" ")
        if NAMES.fullmatch(name) is None or role not in list(Role):
            raise ConfigError(f"{path}: '{line[:80]}' is no name with a role", "Copy the robot's bundle again.")
        roles[name] = Role(role)
    return roles


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(LONGEST_BYTES)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}", "Copy the bundle again.") from error
    return data.decode("utf-8", errors="replace")


def _version(folder: Path) -> tuple[Any, ...]:
    """What tells two states of a bundle's files apart; found without opening any, which a crowd could prevent."""
    return tuple(_stamp(folder / name) for name in (CA, CERTIFICATE, KEY, NAME, ROLES))


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns
