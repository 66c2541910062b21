"""Addresses of cameras: who asks, with which password, and what of an address may be shown."""

from dataclasses import dataclass
from urllib.parse import SplitResult, unquote, urlsplit, urlunsplit


@dataclass(frozen=True, slots=True)
class Address:
    """A URL without its name and password, and these beside it. `shown` is what belongs into messages and logs."""

    url: str
    name: str = ""
    password: str = ""

    @property
    def shown(self) -> str:
        """The address without name, password and query: many cameras want their password there."""
        parts = urlsplit(self.url)
        return urlunsplit(parts._replace(query="...", fragment="")) if parts.query else self.url


def parse_address(url: str) -> Address:
    """Take a URL apart. Raises `ValueError` for one that is none."""
    parts = urlsplit(url)
    _ = parts.port  # raises for a port that is none
    if "@" not in parts.netloc:
        return Address(url)
    return Address(urlunsplit(_without_name(parts)), unquote(parts.username or ""), unquote(parts.password or ""))


def shown(url: str) -> str:
    """Return what may be shown of a camera's URL, or of a text that was meant to be one."""
    try:
        return parse_address(url).shown
    except ValueError:
        return "the address" if "@" in url else url


def _without_name(parts: SplitResult) -> SplitResult:
    return parts._replace(netloc=parts.netloc.rpartition("@")[2])
