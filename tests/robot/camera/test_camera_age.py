"""Old pictures never look fresh: what a picture shows says when it was taken, and its stamp has to say so, too."""

import statistics
import threading
import time

import cv2
import msgspec
import numpy as np
import pytest
from camera_watch import CAMERA, Watch
from rude_cameras import Server, clock_stream, rtsp, taken_s

from lira.hal.errors import DeviceError, SensorError
from lira.hal.messages import CompressedImage
from lira.robot.camera.sources import drain as drain_module
from lira.robot.camera.sources.drain import Drain, Frame
from lira.robot.camera.sources.stream_clock import LATE_S, SETTLE_S, StreamClock

FRESH_S = 0.3
HONEST_S = 0.3  # what the camera itself takes to encode and send is not measured, and a test machine is slow
WIDE = msgspec.structs.replace(CAMERA, width_px=640, height_px=360)


def delays(arrivals, period_s=0.1):
    """What the clock says of pictures that were taken every `period_s` and came then."""
    clock = StreamClock()
    return [clock.delay_s(arrived_s, 500.0 + k * period_s) for k, arrived_s in enumerate(arrivals)]


def test_nothing_counts_before_the_lag_has_settled_and_then_a_steady_stream_is_fresh():
    found = delays([100.0 + k * 0.1 for k in range(20)])
    assert found[:3] == [None, None, None]
    assert found[4:] == pytest.approx([0.0] * 16, abs=1e-3)


@pytest.mark.parametrize("speed", [1.3, 2.0, 100.0])
def test_what_had_waited_at_the_start_does_not_look_fresh(speed):
    """Twenty pictures waited; they come faster than they were taken until the queue is empty."""
    arrivals = [100.0 + max(k * 0.1, 2.0 + k * 0.1 / speed) for k in range(200)]
    true_s = [arrived_s - 100.0 - k * 0.1 for k, arrived_s in enumerate(arrivals)]
    for found, late_s in zip(delays(arrivals), true_s, strict=True):
        assert found is None or late_s - found < 0.15
    assert delays(arrivals)[-1] == pytest.approx(0.0, abs=0.02)


def test_growth_is_lateness():
    late = [0.0] * 20 + [0.02 * k for k in range(50)] + [0.0] * 5
    found = delays([100.0 + k * 0.1 + late_s for k, late_s in enumerate(late)])
    assert found[4:] == pytest.approx(late[4:], abs=0.01)


def test_two_clocks_may_drift_for_hours():
    found = delays([100.0 + k * 0.1 * 1.0002 for k in range(100_000)])
    assert max(found[4:]) < 0.01


def test_a_clock_that_goes_back_is_another_clock():
    clock = StreamClock()
    for k in range(20):
        clock.delay_s(100.0 + k * 0.1, 500.0 + k * 0.1)
    assert clock.delay_s(102.0, 3.0) is None
    assert clock.delay_s(102.0 + SETTLE_S + 0.01, 3.0 + SETTLE_S + 0.01) == pytest.approx(0.0, abs=1e-3)
    # One that went on is no reason to call what follows fresh, or late for good.
    assert clock.delay_s(103.0, 54.0) is None
    assert clock.delay_s(103.4, 54.4) == pytest.approx(0.0, abs=1e-3)


class Feed:
    """Reads these one after the other, then nothing."""

    def __init__(self, frames):
        self._waiting, self._empty = iter(frames), threading.Event()

    def __call__(self):
        frame = next(self._waiting, None)
        if frame is None:
            self._empty.set()
            time.sleep(0.01)
        return frame

    def wait(self):
        """Until all were taken; who asks for more has put the last one down."""
        assert self._empty.wait(20.0)


def drained(frames):
    """What reads these, once it has."""
    feed = Feed(frames)
    drain = Drain(feed, lambda: None)
    feed.wait()
    return drain


def test_the_newest_is_kept_and_the_rest_passed_over():
    ended = threading.Event()
    feed = Feed([Frame(1.0 + k, None, k) for k in range(5)])
    drain = Drain(feed, ended.set)
    feed.wait()
    assert drain.newest(1.0) == Frame(5.0, None, 4)
    assert drain.newest(0.05) is None
    drain.close()
    assert ended.is_set()


def test_what_is_late_is_stamped_so_and_what_is_too_late_refused_with_its_lateness():
    steady = [Frame(100.0 + k * 0.1, k * 0.1, k) for k in range(20)]
    slightly, much = Frame(102.0 + 0.2, 2.0, 20), Frame(102.1 + 2.0, 2.1, 21)
    drain = drained([*steady, slightly])
    assert drain.newest(0.1).arrived_s == pytest.approx(102.0, abs=0.01)
    drain.close()
    drain = drained([*steady, much])
    assert drain.newest(0.05).body == 19
    drain.close()
    gate = threading.Event()
    later, read = Feed([much]), Feed(steady)
    drain = Drain(lambda: later() if gate.is_set() else read(), lambda: None)
    read.wait()
    assert drain.newest(0.1).body == 19
    gate.set()
    later.wait()
    with pytest.raises(SensorError, match=r"its pictures come 2\.0 s late"):
        drain.newest(0.1)
    drain.close()


def test_what_ends_the_stream_is_raised_after_the_last_picture():
    frames = iter([Frame(1.0, None, b"x")])

    def read():
        for frame in frames:
            return frame
        raise DeviceError("gone")

    drain = Drain(read, lambda: None)
    time.sleep(0.05)
    assert drain.newest(0.1).body == b"x"
    with pytest.raises(DeviceError, match="gone"):
        drain.newest(0.1)
    drain.close()


class SlowWatch(Watch):
    """Takes `slow_s` for each picture, and notes true and stamped age as it gets them."""

    def __init__(self, url, slow_s, camera):
        super().__init__(url, camera=camera)
        self.slow_s, self.ages_s, self.stamped_s = slow_s, [], []

    def put(self, picture):
        now_s = time.monotonic()
        pixels = picture.data
        if isinstance(picture, CompressedImage):
            pixels = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
        self.ages_s.append(now_s - taken_s(pixels, now_s))
        self.stamped_s.append(now_s - picture.stamp_s)
        time.sleep(self.slow_s)
        super().put(picture)


def check_ages(watch):
    """Each picture is about as old as its stamp says, and half of them at least are fresh."""
    hidden_s = [true_s - stamped_s for true_s, stamped_s in zip(watch.ages_s, watch.stamped_s, strict=True)]
    assert max(hidden_s) < HONEST_S, (watch.ages_s, watch.stamped_s)
    assert statistics.median(watch.stamped_s) < FRESH_S, watch.stamped_s


@pytest.mark.parametrize("stamped", [True, False], ids=["with X-Timestamp", "without"])
def test_large_jpegs_and_a_slow_consumer(stamped):
    with (
        Server(clock_stream((1920, 1080), 10, stamped)) as server,
        SlowWatch(server.url, 0.25, WIDE) as watch,
    ):
        watch.wait(12, 20.0)
        check_ages(watch)
        assert watch.supervisor.losses == 0


def test_rtsp_and_a_slow_consumer():
    with (
        Server(rtsp((1280, 720), 10)) as server,
        SlowWatch(f"rtsp://127.0.0.1:{server.port}/", 0.2, WIDE) as watch,
    ):
        watch.wait(12, 20.0)
        check_ages(watch)
        assert watch.pictures[-1].data.shape == (360, 640, 3)


def test_what_waited_in_a_stalled_network_is_not_shown_as_new():
    stall = threading.Event()
    with (
        Server(rtsp((640, 480), 15, stall)) as server,
        SlowWatch(f"rtsp://127.0.0.1:{server.port}/", 0.0, CAMERA) as watch,
    ):
        watch.wait(5, 20.0)
        stall.set()
        time.sleep(0.8)
        before = len(watch.pictures)
        stall.clear()
        watch.wait(before + 5, 20.0)
        check_ages(watch)
        assert max(watch.stamped_s) < LATE_S + HONEST_S


def test_a_password_of_an_rtsp_address_is_in_no_message(capfd):
    from lira.robot.camera.sources.opening import open_source

    def refuse(server, connection, _):
        connection.sendall(b"RTSP/1.0 401 Unauthorized\r\nCSeq: 1\r\n\r\n")

    with Server(refuse) as server:
        with pytest.raises(DeviceError, match="no camera opens") as told:
            open_source(f"rtsp://me:hunter2@127.0.0.1:{server.port}/a?pw=hunter3", (640, 480), None)
        assert "hunter" not in str(told.value)
    assert "hunter" not in "".join(capfd.readouterr())


def test_the_time_to_give_up_on_a_late_picture_is_that_of_its_topic():
    from lira.hal.bus.topics import CAMERA as TOPIC

    assert TOPIC.max_age_s >= drain_module.LATE_S
