"""A certificate that ends soon is told of while there is time: at the start and once a day, in the week before it ends.

After its end no link with it comes up, and those that are up are closed. Certificates are read here without any
library but Python's own, as a robot has no other.
"""

import ssl
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from lira.hal.bus.security.keys import CERTIFICATE, Keys
from lira.hal.words import plural

SOON_DAYS = 7
DAY_S = 86400.0
_VERSION, _UTC_TIME = 0xA0, 0x17  # DER's tags
_VALIDITY = 3  # of the fields of a certificate, without its version: after number, algorithm and issuer
_lock = threading.Lock()
_told: dict[Path, float] = {}  # when, by certificate: a process has several sessions with one


def ends_at(certificate: Path) -> datetime:
    """Return when a certificate in a PEM file ends. Raises `OSError`, `ValueError` for what is none."""
    data = ssl.PEM_cert_to_DER_cert(certificate.read_text(encoding="ascii"))
    try:
        _, whole = next(_items(data))
        _, signed = next(_items(whole))
        fields = [content for tag, content in _items(signed) if tag != _VERSION]
        _, (tag, end) = _items(fields[_VALIDITY])
    except (IndexError, StopIteration) as error:
        raise ValueError(f"{certificate} holds no certificate") from error
    form = "%y%m%d%H%M%SZ" if tag == _UTC_TIME else "%Y%m%d%H%M%SZ"
    return datetime.strptime(end.decode("ascii"), form).replace(tzinfo=UTC)


def _items(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Take DER apart: the tag and the content of each item. Raises `IndexError` for what is cut off."""
    at = 0
    while at < len(data):
        tag, length = data[at], data[at + 1]
        at += 2
        if length & 0x80:
            more = length & 0x7F
            length, at = int.from_bytes(data[at : at + more], "big"), at + more
        yield tag, data[at : at + length]
        at += length


def reminder(name: str, ends: datetime, now: datetime) -> str:
    """Return what to say of a certificate, in one line with the remedy; "" while it lasts."""
    days = (ends - now).days
    if days > SOON_DAYS:
        return ""
    when = f"ended on {ends:%Y-%m-%d}" if ends <= now else f"ends on {ends:%Y-%m-%d}, in {plural(days, 'day')}"
    return (
        f"the certificate of '{name}' {when}. Renew it where the keys were made, with: lira keys renew {name}; "
        f"and copy its {CERTIFICATE} here"
    )


class Reminder:
    """Says it now, and from now on once a day, whatever certificate is there by then."""

    def __init__(self, keys: Keys, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> None:
        self._path, self._name, self._now = keys.folder / CERTIFICATE, keys.name, now
        self._closed = threading.Event()
        self._look()
        threading.Thread(target=self._run, name="certificate", daemon=True).start()

    def close(self) -> None:
        """Say no more."""
        self._closed.set()

    def _run(self) -> None:
        while not self._closed.wait(DAY_S):
            self._look()

    def _look(self) -> None:
        with suppress(OSError, ValueError), _lock:  # zenoh says what is wrong with one that cannot be read
            line, now = reminder(self._name, ends_at(self._path), self._now()), self._now().timestamp()
            if line and now - _told.get(self._path, -DAY_S) >= DAY_S / 2:
                _told[self._path] = now
                print(f"warning: {line}", file=sys.stderr, flush=True)
