"""A robot on one bus, and the arena that it stands in on another, with a clock of its own."""

import threading
import time
from contextlib import closing, contextmanager
from dataclasses import replace

import msgspec
import pytest
from wiring import PROFILE, Served, new_endpoint, real_time_null

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import REALTIME, Info
from lira.hal.client.arena import WiredArena
from lira.hal.client.connect import open_remote
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Command, Episode, Reason, Twist
from lira.hal.server.arena import ArenaLoop

APART_S = 5000.0  # between the two clocks
GO = Twist(0.5, 0.0)


class Elsewhere:
    """The arena of a null robot, as another process with another clock sees it."""

    def __init__(self, inner):
        self.inner = inner
        self.speed_at_reset = None

    def now(self):
        return time.monotonic() - APART_S

    def reset(self, episode):
        if episode.layout == 9:
            raise BusError("no such layout", "Choose another.")
        self.speed_at_reset = self.inner.state().linear_m_s
        self.inner.reset(episode)

    def state(self):
        state = self.inner.state()
        return replace(state, stamp_s=state.stamp_s - APART_S)


@contextmanager
def apart():
    """Yield a remote robot, its arena from the other bus, the arena itself, and what ends it."""
    served = Served(real_time_null())
    elsewhere, endpoint, stop = Elsewhere(served.inner), new_endpoint(), threading.Event()
    arena_bus = Bus(served.name, listen=endpoint)
    info = Info(PROFILE, REALTIME, arena_bus.epoch, msgspec.Raw(b'"a world"'))
    loop = threading.Thread(target=ArenaLoop(elsewhere, arena_bus, info, elsewhere.now).run, args=[stop])
    loop.start()
    buses = Bus(served.name, connect=served.endpoint), Bus(served.name, connect=endpoint)
    try:
        with closing(open_remote(buses[0])) as robot:
            yield robot, WiredArena(buses[1], robot), elsewhere, stop
    finally:
        stop.set()
        loop.join(5.0)
        for bus in (*buses, arena_bus):
            assert bus.close()
        served.end()


def drive(robot, twist, seconds):
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        applied = robot.drive(Command(twist, robot.now()))
        robot.wait(robot.now() + 0.05)
    return applied


def test_the_truth_is_fresh_and_on_the_robots_clock():
    with apart() as (robot, arena, _, _):
        assert arena.info == b'"a world"'
        drive(robot, STOP, 0.2)
        drive(robot, GO, 0.5)
        state, now_s = arena.state(), robot.now()
        assert 0.0 <= now_s - state.stamp_s < 0.3
        assert state.linear_m_s == 0.5
        assert state.x_m > 0.1


def test_a_reset_puts_down_a_robot_whose_wheels_stand_and_shows_nothing_of_before():
    with apart() as (robot, arena, elsewhere, _):
        drive(robot, STOP, 0.2)
        drive(robot, GO, 0.5)
        arena.reset(Episode(start_m=30.0))
        assert elsewhere.speed_at_reset == 0.0
        assert arena.state().x_m == pytest.approx(30.0)
        assert robot.read().odom.x_m == pytest.approx(30.0)
        # The robot is still armed: it goes on from there.
        assert drive(robot, GO, 0.3).reason is Reason.OK
        assert 30.0 < arena.state().x_m < 31.0


def test_a_refused_reset_says_why():
    with apart() as (_, arena, _, _), pytest.raises(BusError, match="no such layout"):
        arena.reset(Episode(layout=9))


def ask_on(arena):
    """What was on its way still comes, and is the truth for a moment."""
    for _ in range(10):
        time.sleep(0.5)
        arena.state()


def test_an_arena_that_falls_silent_is_an_error_and_no_old_truth():
    with apart() as (_, arena, _, stop):
        arena.state()
        stop.set()
        with pytest.raises(BusError, match="does not say where"):
            ask_on(arena)
