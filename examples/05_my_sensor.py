"""A sensor of your own: an infrared ranger on the robot, read at the other end of the bus.

A range travels already: fill in `ranges`. A new kind of sensor is a message, a row in the table of topics and a driver;
what a robot learns from is a row of another table, see docs/howto/sensor.md.
"""

import math
from dataclasses import replace
from threading import Event, Thread

import lira

ADDRESS, NAME = "127.0.0.1:17447", "sensing"


class WithRanger(lira.Twin):
    """The twin, with a ranger on its front left corner; on a real robot `read` would ask the device."""

    def read(self) -> lira.Observation:
        """Add the ranger's reading: the free way to the nearest box, as far as such a thing sees."""
        seen, free = super().read(), self.state().clearance_m
        return replace(seen, ranges=(lira.Range(seen.stamp_s, "range_fl", free if free < 4 else math.inf, 0.03, 4.0),))


if __name__ == "__main__":
    stop, up = Event(), Event()
    twin = WithRanger(lira.load_profile("thesis-sim"), "line-obstacles", realtime_factor=1.0)
    options = {"arena": twin, "arena_info": twin.info, "stop": stop, "ready": lambda _bus, _stop: up.set()}
    server = Thread(target=lira.serve, args=(twin, NAME, ADDRESS), kwargs=options)
    server.start()
    try:
        up.wait(60.0)
        with lira.connect(ADDRESS, NAME) as robot:
            for step in lira.drive(robot, "lidar-expert", steps=15):
                print(*(f"{each.frame_id}: {each.range_m:.2f} m" for each in step.observation.ranges))
    finally:
        stop.set()
        server.join()
