import struct
import threading
import time
from itertools import pairwise

import pytest

from lira.hal.errors import ConfigError, DeviceError
from lira.robot import supervisor as page
from lira.robot.supervisor import Supervisor


@pytest.fixture
def tried(monkeypatch):
    """A supervisor whose sessions fail with what is in the list, then work until closed; and when each began."""
    monkeypatch.setattr(page, "RETRY_S", 0.05)
    monkeypatch.setattr(page, "SLOWEST_S", 0.2)
    failures, begun_s = [], []

    def session(stop, begin):
        begun_s.append(time.monotonic())
        if failures:
            raise failures.pop(0)
        begin()
        stop.wait()

    made = Supervisor("lidar", session)
    yield made, failures, begun_s
    made.close()


def test_it_opens_again_after_any_exception_more_slowly_each_time(tried):
    supervisor, failures, begun_s = tried
    failures += [
        DeviceError("gone", "Plug it in."),
        ValueError("cannot\nreshape"),
        struct.error(),
        MemoryError(),
        OSError(),
    ]
    supervisor.start()
    supervisor.wait_alive(5.0)
    assert supervisor.failure is None
    waits_s = [after - before for before, after in pairwise(begun_s)]
    assert all(wait_s >= least_s for wait_s, least_s in zip(waits_s, [0.05, 0.1, 0.2, 0.2, 0.2], strict=True))
    assert (supervisor.sessions, supervisor.losses) == (1, 0)


def test_a_fault_of_a_driver_is_one_line_with_a_remedy(tried):
    supervisor, failures, _ = tried
    failures += [ValueError("cannot\nreshape")] * 50
    supervisor.start()
    with pytest.raises(DeviceError) as told:
        supervisor.wait_alive(0.3)
    assert told.value.what == "the driver of the lidar failed: ValueError: cannot reshape"
    assert told.value.remedy


def test_the_start_tries_until_its_time_is_up(tried):
    supervisor, failures, _ = tried
    failures += [DeviceError("it boots", "Wait.")] * 3
    supervisor.start()
    supervisor.wait_alive(5.0)
    assert supervisor.alive


def test_what_no_further_try_can_mend_is_told_at_once(tried):
    supervisor, failures, _ = tried
    failures += [ConfigError("'x' is no camera", "Give another.")] * 50
    supervisor.start()
    began_s = time.monotonic()
    with pytest.raises(ConfigError, match="no camera"):
        supervisor.wait_alive(20.0)
    assert time.monotonic() - began_s < 5.0


def test_every_session_that_worked_and_ended_is_a_loss_and_a_long_one_earns_a_quick_next(monkeypatch):
    monkeypatch.setattr(page, "RETRY_S", 0.01)
    monkeypatch.setattr(page, "SLOWEST_S", 60.0)
    monkeypatch.setattr(page, "WORKED_S", 0.0)
    enough = threading.Event()

    def session(stop, begin):
        begin()
        if supervisor.sessions > 20:
            enough.set()
            stop.wait()
        raise DeviceError("lost", "Plug it in.")

    supervisor = Supervisor("base", session)
    supervisor.start()
    assert enough.wait(5.0)
    assert supervisor.losses == 20
    supervisor.close()
