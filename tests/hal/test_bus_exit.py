"""A process that gives up on a robot that is not there ends as it should: in time, and not by a signal."""

import subprocess
import sys

import pytest

from lira.tools.launch.processes import free_port

SCRIPT = """
import sys, time
import numpy, torch  # a heavy import widens the time between the end of the program and the end of the process
from lira.hal.bus.bus import Bus
bus = Bus("nobody", connect=sys.argv[1])
time.sleep(float(sys.argv[2]))
bus.close()
"""


@pytest.mark.parametrize("after_s", [0.0, 0.5, 2.0, 2.9])
def test_a_bus_that_is_still_connecting_lets_the_process_end(after_s):
    command = [sys.executable, "-c", SCRIPT, f"127.0.0.1:{free_port()}", str(after_s)]
    ended = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60.0)
    assert (ended.returncode, ended.stderr) == (0, "")
