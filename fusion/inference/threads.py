"""How many threads compute: one, so that a result depends neither on the number of cores nor on who else computes."""

import os

from threadpoolctl import threadpool_limits


def one_thread() -> None:
    """Let numpy, and torch where it is used, multiply matrices on one thread from here on.

    Ours are small, and several threads would wait for each other. What is loaded later, and what this process starts,
    goes by the environment.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    threadpool_limits(1)
