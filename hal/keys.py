"""Keys: what a bus needs to be encrypted and mutually authenticated. Made by `lira keys`; here they are only read.

A bundle is a folder of one peer: `ca.pem`, `cert.pem`, `key.pem` (0600), `writers.txt` (the names of those whose
messages it takes, one a line). The robot takes them from its operators, everybody else from the robot alone.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hal.errors import ConfigError

VARIABLE = "LIRA_KEYS"
CA, CERTIFICATE, KEY, WRITERS = "ca.pem", "cert.pem", "key.pem", "writers.txt"
KEY_MODE = 0o600

# Everything but putting values: to listen, to ask, to answer, to say that one is there.
_ASKING = [
    "declare_subscriber",
    "declare_queryable",
    "query",
    "reply",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
]
# `**` does not reach below a part that begins with @: late readers of latched topics ask there.
_ALL_KEYS = ["**", "**/@adv/**"]


@dataclass(frozen=True, slots=True)
class Keys:
    """One peer's bundle. `writers` are the names on the certificates of those it takes messages from."""

    folder: Path
    writers: tuple[str, ...]

    def zenoh_config(self, robot: str) -> dict[str, Any]:
        """Return the session's settings: TLS both ways, and who may put what below the robot's name."""
        paths = {name: str(self.folder / name) for name in (CA, CERTIFICATE, KEY)}
        everybody, writers = "everybody", "writers"
        rules = [
            _rule("ask", _ASKING, ["ingress", "egress"], _ALL_KEYS),
            _rule("send", ["put", "delete"], ["egress"], _ALL_KEYS),
            _rule("take", ["put", "delete"], ["ingress"], [f"{robot}/**", f"{robot}/**/@adv/**"]),
        ]
        policies = [{"rules": ["ask", "send"], "subjects": [everybody]}]
        subjects: list[dict[str, Any]] = [{"id": everybody}]
        if self.writers:
            subjects.append({"id": writers, "cert_common_names": list(self.writers)})
            policies.append({"rules": ["take"], "subjects": [writers]})
        return {
            "transport/link/tls": {
                "root_ca_certificate": paths[CA],
                "listen_certificate": paths[CERTIFICATE],
                "listen_private_key": paths[KEY],
                "connect_certificate": paths[CERTIFICATE],
                "connect_private_key": paths[KEY],
                "enable_mtls": True,
                # A robot's address changes; that it is the robot is seen by the name in `writers`.
                "verify_name_on_connect": False,
            },
            "access_control": {
                "enabled": True,
                "default_permission": "deny",
                "rules": rules,
                "subjects": subjects,
                "policies": policies,
            },
        }


def _rule(name: str, messages: list[str], flows: list[str], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "messages": messages, "flows": flows, "key_exprs": keys}


def keys_from_environment() -> Keys | None:
    """Load the bundle that LIRA_KEYS names; None without one. Raises `ConfigError`."""
    folder = os.environ.get(VARIABLE)
    return load_keys(Path(folder)) if folder else None


def load_keys(folder: Path) -> Keys:
    """Load a bundle. Raises `ConfigError` if a file is missing or the key may be read by others."""
    for name in (CA, CERTIFICATE, KEY, WRITERS):
        if not (folder / name).is_file():
            raise ConfigError(f"{folder} holds no keys: {name} is missing", f"Make some with: lira keys init {folder}")
    if (folder / KEY).stat().st_mode & 0o077:
        raise ConfigError(f"others may read {folder / KEY}", f"Close it with: chmod 600 {folder / KEY}")
    lines = (folder / WRITERS).read_text(encoding="utf-8").split()
    return Keys(folder.resolve(), tuple(lines))
