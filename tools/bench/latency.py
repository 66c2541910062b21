"""From a capture to the applied command: HAL server, bus, client, bus, governor, beside a bare zenoh echo.

Both ends of the interval are on the robot's clock: the scan's capture time and the time at which the wheels got the
command that answers it. The echo sends the same scan's bytes there and back, in the same run.
"""

import statistics
import sys
import time
from contextlib import suppress
from queue import Empty, SimpleQueue

import numpy as np

from lira.hal.bus.attachment import Attachment
from lira.hal.client.connect import connect
from lira.hal.errors import BusError
from lira.hal.messages import STOP, LaserScan
from lira.hal.messages.ros.codec import encode
from lira.tools.bench import Row
from lira.tools.bench.parts import echo
from lira.tools.bench.parts.answers import Answers
from lira.tools.bench.parts.robots import READY_S, null_robot_at_work
from lira.tools.launch.processes import ChildProcess, free_port

RUNS = 3
SCANS = 150
SCAN_HZ = 40.0
WARM_UP = 20
LIMIT_S = 30.0
POLL_S = 0.0005
LOST_S = 0.5  # an echo that has not come by then was lost, as the first ones are before both know each other


def run() -> list[Row]:
    """Return one row: medians over several runs in fresh processes."""
    runs = [measure() for _ in range(RUNS)]
    row: Row = {name: statistics.median(one[name] for one in runs) for name in runs[0]}
    return [{"profile": "thesis-sim", "scan_hz": SCAN_HZ, "samples": SCANS, **row}]


def measure() -> dict[str, float]:
    """Measure the stack and the echo side by side."""
    echo_endpoint = f"127.0.0.1:{free_port()}"
    with (
        null_robot_at_work(str(SCAN_HZ)) as (name, endpoint, folder),
        ChildProcess("the echo", [sys.executable, "-m", echo.__name__, echo_endpoint], folder / "echo.log") as mirror,
    ):
        mirror.wait_ready(echo.READY, READY_S)
        stack_ms, scan = measure_stack(name, endpoint)
        echo_ms = measure_echo(echo_endpoint, scan)
    p50, p99 = (float(np.percentile(stack_ms, q)) for q in (50, 99))
    echo_p50, echo_p99 = (float(np.percentile(echo_ms, q)) for q in (50, 99))
    return {
        "p50_ms": p50,
        "p99_ms": p99,
        "echo_p50_ms": echo_p50,
        "echo_p99_ms": echo_p99,
        "ratio_p50": p50 / echo_p50,
        "ratio_p99": p99 / echo_p99,
    }


def measure_stack(name: str, endpoint: str) -> tuple[list[float], LaserScan]:
    """Answer every scan at once, and find when each answer was applied."""
    with connect(endpoint, name) as robot:
        answers = Answers(robot, STOP)
        taken_ms: list[float] = []
        deadline_s = time.monotonic() + LIMIT_S
        while len(taken_ms) < SCANS + WARM_UP and time.monotonic() < deadline_s:
            taken_ms += answers.poll()
            time.sleep(POLL_S)
        newest = answers.scans.newest()
        if newest is None or len(taken_ms) < SCANS + WARM_UP:
            raise BusError(f"{len(taken_ms)} of {SCANS + WARM_UP} commands were applied", "Is the machine overloaded?")
        return taken_ms[WARM_UP:], newest.message


def measure_echo(endpoint: str, scan: LaserScan) -> list[float]:
    """Send the scan's bytes to the echo and back, at the same rate. As with commands, what is lost is lost."""
    payload, attachment = encode(scan), Attachment(1, 1, 1).to_bytes()
    taken_ms: list[float] = []
    deadline_s = time.monotonic() + LIMIT_S
    with echo.session("connect", endpoint) as bare:
        came: SimpleQueue[float] = SimpleQueue()
        _answers = bare.declare_subscriber(echo.ANSWER, lambda _: came.put(time.perf_counter()))
        questions = echo.publisher(bare, echo.QUESTION)
        while len(taken_ms) < SCANS + WARM_UP:
            if time.monotonic() > deadline_s:
                raise BusError(f"{len(taken_ms)} of {SCANS + WARM_UP} echoes came back", "Is the machine overloaded?")
            began_s = time.perf_counter()
            questions.put(payload, attachment=attachment)
            with suppress(Empty):
                taken_ms.append(1e3 * (came.get(timeout=LOST_S) - began_s))
            time.sleep(1.0 / SCAN_HZ)
    return taken_ms[WARM_UP:]
