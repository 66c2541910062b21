"""What zenoh refuses before anybody here sees it: links without a valid certificate, links when this process may open
no more files, messages nobody may send.

zenoh tells of that in its log alone, and writes that to standard output. So it gets a descriptor 1 of its own, and what
the log says is counted. Neither a full pipe nor a reader that died holds zenoh up: what does not fit is lost.
"""

import contextlib
import os
import re
import sys
import threading
from collections import Counter

import zenoh

from lira.hal.bus.security.keys import keys_from_environment

LINK, FULL, MESSAGE = "links", "links for want of files", "messages"
# One line for each link that its acceptor gave up, one for each message that the access list stopped, nothing else.
FILTER = (
    "off,zenoh_link_tls=warn,zenoh_link_commons=warn,"
    "zenoh::net::routing::interceptor=trace,zenoh::net::routing::interceptor::access_control=off,"
    "zenoh::net::routing::interceptor::low_pass=off"
)
VARIABLE = "RUST_LOG"
_LINK = re.compile(rb"zenoh_link_\S+: .*Hint: increase the system open file limit")
_FULL = b"Too many open files"
_MESSAGE = re.compile(rb"zenoh::net::routing::interceptor: Msg intercepted")
LONGEST = 65536


class Refusals:
    """Counts what zenoh's log says, by kind. Pure; `feed` takes the log as it comes."""

    def __init__(self) -> None:
        self._counts = Counter({LINK: 0, FULL: 0, MESSAGE: 0})
        self._rest = b""

    @property
    def counts(self) -> dict[str, int]:
        """How many of each, so far."""
        return dict(self._counts)

    def feed(self, data: bytes) -> list[bytes]:
        """Count in what was written; returns the lines in it that tell of no refusal."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[-LONGEST:]
        return [line for line in lines if not self._count(line)]

    def _count(self, line: bytes) -> bool:
        if _MESSAGE.search(line):
            kind = MESSAGE
        elif _LINK.search(line):
            kind = FULL if _FULL in line else LINK
        else:
            return False
        self._counts[kind] += 1
        return True


def count_refusals() -> Refusals:
    """Count from now on, for this whole process: call it once, before the first session opens.

    Without keys nobody is refused, and nothing is done. What else is written to descriptor 1 is passed on.
    """
    refusals = Refusals()
    if keys_from_environment() is None:
        return refusals
    sys.stdout.flush()
    shown = os.dup(1)
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    os.dup2(sink, 1)
    os.close(sink)
    sys.stdout = os.fdopen(os.dup(shown), "w", buffering=1, encoding="utf-8")
    os.environ["NO_COLOR"] = "1"
    os.environ[VARIABLE] = ",".join(filter(None, (FILTER, os.environ.get(VARIABLE))))
    zenoh.init_log_from_env_or(FILTER)
    threading.Thread(target=_listen, args=(source, shown, refusals), name="refusals", daemon=True).start()
    return refusals


def _listen(source: int, shown: int, refusals: Refusals) -> None:
    while data := os.read(source, LONGEST):
        for line in refusals.feed(data):
            with contextlib.suppress(OSError):  # nobody looks any more
                os.write(shown, line + b"\n")
