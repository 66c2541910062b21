"""A thread that takes whatever a camera sends, at once, and keeps the newest: what nobody fetches does not get old."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from lira.hal.errors import SensorError
from lira.robot.camera.sources.stream_clock import LATE_S, StreamClock

JOIN_S = 1.5
Body = TypeVar("Body")


@dataclass(frozen=True, slots=True)
class Frame(Generic[Body]):
    """Something that came: when, on the monotonic clock, and the stream's own time if it has one."""

    arrived_s: float
    stream_s: float | None
    body: Body


class Drain(Generic[Body]):
    """Calls `read` in a thread until closed, or until it raises; then `end`, in the same thread.

    `read` returns what came, None if nothing did, and comes back in time. What it raises, `newest` raises.
    """

    def __init__(self, read: Callable[[], Frame[Body] | None], end: Callable[[], None]) -> None:
        self._read = read
        self._end = end
        self._changed = threading.Condition()
        self._newest: Frame[Body] | None = None
        self._failure: Exception | None = None
        self._late_s: float | None = None  # how late the last one was, if it was too late
        self._stopped = False
        self._clock = StreamClock()
        self._thread = threading.Thread(target=self._run, name="camera-drain", daemon=True)
        self._thread.start()

    def newest(self, timeout_s: float) -> Frame[Body] | None:
        """Return what came last, `arrived_s` put back by what it was late; None if there is nothing new.

        Raises `SensorError` if what came was too late, and whatever `read` raised.
        """
        until_s = time.monotonic() + timeout_s
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._failure, timeout_s)
            frame, self._newest = self._newest, None
            late_s, self._late_s = self._late_s, None
            if frame is not None:
                return frame
            if self._failure is not None:
                raise self._failure
        if late_s is None or time.monotonic() < until_s:
            return None
        raise SensorError(
            f"its pictures come {late_s:.1f} s late",
            "Use smaller pictures, a better network or a faster computer.",
        )

    def close(self) -> None:
        """End the thread; one that is held up ends as soon as it comes back. May be called twice."""
        self._stopped = True
        self._thread.join(JOIN_S)

    def _run(self) -> None:
        try:
            while not self._stopped:
                frame = self._read()
                if frame is not None:
                    self._keep(frame)
        except Exception as error:  # noqa: BLE001 - raised again by whoever fetches
            with self._changed:
                self._failure = error
                self._changed.notify_all()
        finally:
            self._end()

    def _keep(self, frame: Frame[Body]) -> None:
        delay_s: float | None = 0.0
        if frame.stream_s is not None:
            delay_s = self._clock.delay_s(frame.arrived_s, frame.stream_s)
        if delay_s is None:
            return
        with self._changed:
            if delay_s > LATE_S:
                self._late_s = delay_s
                return
            self._newest, self._late_s = replace(frame, arrived_s=frame.arrived_s - delay_s), None
            self._changed.notify_all()
