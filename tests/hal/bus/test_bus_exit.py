"""A process that gives up on a robot that is not there ends as it should: in time, and not by a signal."""

import subprocess
import sys

from lira.tools.launch.processes import free_port

# What lingers widens the time between the end of the program and the end of the process, as heavy libraries do: a
# thread that comes out of zenoh then makes Python abort.
SCRIPT = """
import sys, time
class Lingering:
    def __del__(self, sleep=time.sleep):
        sleep(1.0)
lingering = Lingering()
from lira.hal.bus.bus import Bus
bus = Bus("nobody", connect=sys.argv[1])
time.sleep(float(sys.argv[2]))
bus.close()
"""
MOMENTS_S = (0.0, 0.5, 2.0, 2.9)  # of an attempt to connect


def test_a_bus_that_is_still_connecting_lets_the_process_end():
    nobody = f"127.0.0.1:{free_port()}"
    commands = [[sys.executable, "-c", SCRIPT, nobody, str(after_s)] for after_s in MOMENTS_S]
    started = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for command in commands]
    told = [process.communicate(timeout=60.0)[1] for process in started]
    assert [(process.returncode, words) for process, words in zip(started, told, strict=True)] == [(0, "")] * 4
