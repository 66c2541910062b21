"""On a dead link everything ends in bounded time, the wheels first."""

import time

from wiring import new_endpoint, real_time_null, served, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, Twist
from lira.hal.profile import STOP_BUDGET_S
from lira.tools.launch.link_fault import Relay

GO = Twist(0.5, 0.0)


def test_both_ends_close_in_time_though_the_link_is_dead():
    with served(real_time_null()) as robot:
        front = new_endpoint()
        with Relay(int(front.split(":")[1]), int(robot.endpoint.split(":")[1])) as relay:
            bus = Bus(robot.name, connect=front)
            client = open_remote(bus)
            wait_for(lambda: client.drive(Command(STOP, client.now())).reason == "ok")
            wait_for(lambda: client.drive(Command(GO, client.now())).twist == GO)
            relay.faults.dark = True
            dark_s = time.monotonic()
            wait_for(lambda: robot.inner.state().linear_m_s == 0.0, STOP_BUDGET_S + 0.5)
            client.close()
            bus.close()
            assert time.monotonic() - dark_s < 5.0
            ending_s = time.monotonic()
            robot.stop.set()
            robot.join()
            assert time.monotonic() - ending_s < 6.0
