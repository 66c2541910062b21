"""Where what others send meets our threads: what fails while one message is handled is refused, counted and over.

Whoever loops over messages or questions puts the handling of each into `guard`. So whatever somebody sends, it costs
that one message; a thread ends by its own faults alone (a device, a bus that was closed).
"""

import contextlib
import sys
from collections import Counter
from collections.abc import Iterator

from lira.hal.errors import BusError, CodecError

UNDECODABLE = "undecodable"


class Boundary:
    """Counts what was refused, by the key it came on (or was to go out on) and the reason."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    @property
    def counts(self) -> dict[tuple[str, str], int]:
        """How many messages were refused, by key and reason."""
        return dict(self._counts)

    def refuse(self, key: str, reason: str, count: int = 1) -> None:
        """Count what is not taken."""
        self._counts[key, reason] += count

    @contextlib.contextmanager
    def guard(self, key: str) -> Iterator[None]:
        """Refuse the message that is handled inside if anything goes wrong with it. Passes `BusError` on."""
        try:
            yield
        except BusError:
            raise
        except CodecError:
            self.refuse(key, UNDECODABLE)
        except Exception as error:  # noqa: BLE001 - whatever somebody else's message does, it ends here
            reason = type(error).__name__
            if (key, reason) not in self._counts:
                # Nobody foresaw it, so it is told once: the count alone would hide a fault of ours.
                with contextlib.suppress(OSError, AttributeError):
                    print(f"refused what came on '{key}': {reason}: {error}"[:300], file=sys.stderr, flush=True)
            self.refuse(key, reason)
