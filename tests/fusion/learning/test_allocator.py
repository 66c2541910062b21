"""What a batch gives back stays with the process."""

import platform
import resource
import subprocess
import sys

import numpy as np
import pytest

from lira.fusion.learning.allocator import keep_freed_memory

BATCHES, ARRAYS, BYTES = 10, 8, 2**21
PAGES = BATCHES * ARRAYS * BYTES // resource.getpagesize()


def page_faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(BATCHES):
        [np.ones(BYTES, np.uint8) for _ in range(ARRAYS)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library has an allocator of its own")
def test_a_page_is_asked_for_once():
    def of_a_new_process(*words):
        return int(subprocess.check_output([sys.executable, __file__, *words], timeout=60))

    assert of_a_new_process() > PAGES / 2  # else there is nothing to spare here
    assert of_a_new_process("keep") < PAGES / 10


if __name__ == "__main__":
    if "keep" in sys.argv:
        keep_freed_memory()
    print(page_faults())
