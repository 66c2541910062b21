"""Keeps C code that prints to itself."""

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what pybullet prints from C off the screen and out of a report that a program reads.

    A process that may open no more files is not quiet, but goes on.
    """
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    sys.stderr.flush()
    libc.fflush(None)
    with ExitStack() as stack:
        try:
            kept = [_open(stack, os.dup, stream) for stream in (1, 2)]
            nowhere = _open(stack, os.open, os.devnull, os.O_WRONLY)
        except OSError:
            yield
            return
        try:
            for stream in (1, 2):
                os.dup2(nowhere, stream)
            yield
        finally:
            libc.fflush(None)
            for stream, copy in zip((1, 2), kept, strict=True):
                os.dup2(copy, stream)


def _open(stack: ExitStack, opener: Callable[..., int], *words: object) -> int:
    descriptor = opener(*words)
    stack.callback(os.close, descriptor)
    return descriptor
