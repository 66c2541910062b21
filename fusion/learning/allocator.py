"""What the C library does with memory that a batch gives back."""

import ctypes

KEPT_BYTES = 256 * 2**20  # a batch of thirty-two pictures through 32 filters takes some 20 MB there and back
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # malloc.h of glibc


def keep_freed_memory() -> None:
    """Let this process keep up to 256 MB that it frees, for the next batch.

    Otherwise glibc gives the large arrays of each batch back to the system and asks for them again, a page at a time,
    which takes a tenth of a training step. Other C libraries are left as they are.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, KEPT_BYTES)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)
