"""A terminal, a supervisor and a person who all ask a driving robot to end, again and again: it stands, and ends."""

import itertools
import signal
import time

import pytest
from scene import BUDGET_S, Scene

BURST_S = 0.2
ENDS_S = 10.0


@pytest.mark.parametrize("kind", ["null", "wire"])
def test_signals_that_come_on_top_of_each_other_stop_the_wheels_and_end_the_process(kind, tmp_path):
    with Scene(kind, tmp_path) as scene:
        scene.driver()
        assert scene.wait(scene.moves, 10.0)
        asked_s = time.monotonic()
        for number in itertools.cycle((signal.SIGINT, signal.SIGTERM)):
            scene.robot.signal(number)
            if time.monotonic() > asked_s + BURST_S:
                break
        assert scene.robot.wait(ENDS_S) is not None
        orders = scene.orders()
        assert orders[-1][1] == 0.0
        assert max(at for at, linear in orders if linear) < asked_s + BUDGET_S
