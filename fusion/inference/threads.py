"""How many threads compute: one, so that a result depends neither on the number of cores nor on who else computes."""

from threadpoolctl import threadpool_limits


def one_thread() -> None:
    """Let numpy multiply matrices on one thread from here on: ours are small, and several would wait for each other."""
    threadpool_limits(1)
