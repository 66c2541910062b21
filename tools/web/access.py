"""Who gets in. On this machine whoever can open a page; from others only by a link that is shown once, over TLS.

A page of somewhere else must not reach the robot through a browser that may: the address that a browser names as its
host and as the origin of a request has to be this server's own.
"""

import secrets
import socket
import ssl
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from lira.hal.bus.security.keys import CERTIFICATE, KEY, Keys
from lira.hal.errors import ConfigError

COOKIE = "lira"
LINK_S = 600.0  # a link that nobody has opened by then opens nothing
LOCAL = ("127.0.0.1", "localhost", "[::1]")


@dataclass(slots=True)
class Access:
    """Links that let in, and the sessions of who came by one. `open_here`: no link is asked for; only for loopback."""

    open_here: bool
    hosts: frozenset[str]
    _links: dict[str, tuple[bool, float]] = field(default_factory=dict)
    _sessions: dict[str, bool] = field(default_factory=dict)

    @property
    def best_host(self) -> str:
        """What another machine calls this one: an address rather than a name."""
        return max(self.hosts, key=lambda host: (host not in LOCAL, host[:1].isdigit()))

    def new_link(self, now_s: float, *, drives: bool) -> str:
        """Make a secret that lets one browser in, to drive or to look."""
        link = secrets.token_urlsafe(24)
        self._links[link] = drives, now_s
        return link

    def enter(self, link: str, now_s: float) -> str | None:
        """Use up a link. Returns a session for the cookie, None if the link opens nothing (any more)."""
        drives, made_s = self._links.pop(link, (False, float("-inf")))
        if now_s - made_s > LINK_S:
            return None
        session = secrets.token_urlsafe(24)
        self._sessions[session] = drives
        return session

    def may_look(self, session: str | None) -> bool:
        """Whether a browser with this cookie may look, and press the emergency stop."""
        return self.open_here or session in self._sessions

    def may_drive(self, session: str | None) -> bool:
        """Whether a browser with this cookie may drive and teach."""
        return self.open_here or self._sessions.get(session or "", False)

    def is_own(self, host: str | None, origin: str | None) -> bool:
        """Whether a request names this server, as its host and, where it says so, as its origin."""
        if host is None or _name(host) not in self.hosts:
            return False
        return origin is None or urlsplit(origin).netloc == host


def _name(host: str) -> str:
    """The name of a host without its port."""
    return host if host.endswith("]") else host.rpartition(":")[0] or host


def own_names(host: str) -> frozenset[str]:
    """What a browser may call this server: the address it listens on; if that is all of them, each of the machine's."""
    if is_loopback(host):
        return frozenset(LOCAL)
    if host not in ("0.0.0.0", "::"):
        return frozenset((host, f"[{host}]"))
    name = socket.gethostname()
    return frozenset((*LOCAL, name, f"{name}.local", *addresses()))


def addresses() -> list[str]:
    """The machine's address on the network that it would reach others by; none without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # for documentation only (RFC 5737): nothing is sent
        except OSError:
            return []
        return [probe.getsockname()[0]]


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    return host in (*LOCAL, "::1")


def tls_context(keys: Keys | None, host: str) -> ssl.SSLContext | None:
    """TLS with the bundle's own certificate, None on loopback. Raises `ConfigError` without keys for other machines."""
    if is_loopback(host):
        return None
    if keys is None:
        raise ConfigError(
            f"without keys anybody who reaches {host} could drive the robot",
            "Make keys with: lira keys init keys; name them by LIRA_KEYS; or listen on 127.0.0.1.",
        )
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    try:
        context.load_cert_chain(keys.folder / CERTIFICATE, keys.folder / KEY)
    except (OSError, ssl.SSLError) as error:
        raise ConfigError(f"the keys in {keys.folder} cannot be used: {error}", "Copy the bundle again.") from error
    return context
