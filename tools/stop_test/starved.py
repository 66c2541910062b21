"""How long processes were ready to run, and had no processor: by the account that Linux keeps of each thread."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path


def waits_s(pids: Iterable[int]) -> dict[str, float]:
    """Seconds that each thread of these processes has waited for a processor so far; what has ended counts for nothing.

    A thread that is stopped or sleeps does not wait.
    """
    waits: dict[str, float] = {}
    for path in (path for pid in pids for path in Path(f"/proc/{pid}/task").glob("*/schedstat")):
        with suppress(OSError, IndexError):  # ended meanwhile
            waits[path.parent.name] = int(path.read_text(encoding="ascii").split()[1]) / 1e9
    return waits


def longest_s(before: Mapping[str, float], now: Mapping[str, float]) -> float:
    """How long the thread has waited in between that waited longest."""
    return max((wait_s - before.get(thread, 0.0) for thread, wait_s in now.items()), default=0.0)
