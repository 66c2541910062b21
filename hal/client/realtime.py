"""A client's side of a robot in real time: it estimates the robot's clock and keeps decisions alive between decisions.

Decisions come at 5 Hz and the robot stops after 0.25 s without a command, so a decision is sent again at 20 Hz. Two
ages bound that. The robot judges when a command was last sent: a process that dies stops the robot one time-out after
its last message. This side judges when it was decided: a loop that hangs is kept alive for 0.5 s, and the robot stops
one time-out later. A person's hand is not a decision (it answers no observation): it streams by itself, is judged by
its own stamp and never repeated.

A robot that is started anew has another clock: nothing that was stamped before is kept, and as it has stopped by
itself, the first neutral decision is answered here instead of arming it.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import Info, ask_info
from lira.hal.bus.topics import APPLIED, CMD_VEL, SIM_STATE, TELEOP
from lira.hal.client.remote import RemoteRobot
from lira.hal.client.sensor_reader import Sense
from lira.hal.clock import ClockEstimate
from lira.hal.errors import BusError
from lira.hal.messages import (
    HELD,
    STOP,
    Applied,
    Command,
    CourseState,
    Observation,
    Reason,
    Source,
    is_neutral,
    session_of,
)

T = TypeVar("T")

REPEAT_HZ = 20.0
DECISION_S = 0.5  # age at which a decision is no longer sent
ANSWER_S = 0.05
POLL_S = 0.002
NAP_S = 0.02
NOBODY = -1
HEAR_S = 5.0
AGAIN_S = 0.5  # to ask a robot that was just heard
MOMENT_S = 0.5
FAREWELL = 3  # neutral commands at the end: one may be lost


class RealTimeRobot(RemoteRobot):
    """A robot whose time passes by itself, and that stops when policy is silent for its time-out."""

    def __init__(self, bus: Bus, info: Info) -> None:
        super().__init__(bus, info)
        self._patience_s = info.profile.control.policy_timeout_s
        self._states = Sense(bus, SIM_STATE)
        self._results = bus.reader(APPLIED, depth=16)
        self._publishers = {Source.POLICY: bus.publisher(CMD_VEL), Source.TELEOP: bus.publisher(TELEOP)}
        self._clock = ClockEstimate()
        self._epoch = NOBODY  # of the robot that is listened to
        self._own = session_of(bus.epoch)
        self._newest: Applied | None = None
        self._untold = False  # the robot has stopped by itself, and whoever drives here has not heard of it
        self._held: dict[Source, Command] = {}
        self._repeat_s = 0.0
        # Over the order of what is sent, which a link may hold up; taken before the other one.
        self._sending = threading.Lock()
        # Over the clock, the held decisions and what came back: never held while something is sent.
        self._heard = threading.Condition()
        self._threads = [
            threading.Thread(target=self._run, args=[work, topic.key], name=f"remote-{name}", daemon=True)
            for name, work, topic in (("listen", self._listen, APPLIED), ("repeat", self._repeat, CMD_VEL))
        ]
        ask_info(bus)  # the robot shows what it sees before it answers, and by now it is listened for
        for thread in self._threads:
            thread.start()
        if not _within(HEAR_S, lambda: self._clock.known):
            self._closed.set()
            raise BusError("the robot says nothing about its wheels", "Check that it is still running.")
        self._known_epoch = self._epoch

    def started_anew(self) -> bool:
        """Whether the robot was started anew since this was asked last: times from before mean nothing then.

        Raises `BusError` if it came back as another one.
        """
        epoch = self._epoch
        if epoch == self._known_epoch:
            return False
        try:
            info = ask_info(self.bus, AGAIN_S)
        except BusError:
            return False  # gone again: asked once more the next time
        if (info.profile, info.mode) != (self.profile, self.info.mode):
            what = f"a robot '{info.profile.name}' ({info.mode}) came back in place of '{self.profile.name}'"
            raise BusError(what, "Start this program anew for it.")
        self.info, self._known_epoch = info, epoch
        return True

    def stand(self) -> None:
        """Have the robot stand until the next decision: what was decided before a reset does not drive after it."""
        with self._sending:
            with self._heard:
                now_s = self.now()
                for source, command in self._held.items():
                    self._held[source] = replace(command, twist=STOP, stamp_s=now_s)
                due = self._due(now_s, *self._held)
            self._send(due, now_s)

    def refresh(self, reset_s: float) -> None:
        """Forget what was captured before a reset, and wait a moment for what comes after it."""
        before = self.read()
        self._sensors.forget(reset_s)
        self._states.forget(reset_s)
        _within(MOMENT_S, lambda: self._sensors.has_again(before, self.read()))

    def now(self) -> float:
        """Seconds on the robot's clock, as estimated."""
        self._check_open()
        with self._heard:
            return self._clock.now(time.monotonic())

    def read(self) -> Observation:
        """Return the newest of every sensor that is fresh."""
        return self._sensors.observe(self.now())

    def state(self) -> CourseState | None:
        """Ground truth, None if none comes within a moment."""
        return _within(MOMENT_S, lambda: self._states.read(self.now()))

    def drive(self, command: Command) -> Applied:
        """Send a command and wait a moment for what the robot says it applied on it.

        Returns what it said last if that does not come in time, a stop if it has not said anything lately. A neutral
        decision is not sent while the robot may have stopped by itself without a word here, nor once it has and the
        caller does not know (this call tells): it would arm the robot, and nobody has decided that.
        """
        decided = command.source is Source.POLICY or command.answers >= 0
        with self._sending:
            with self._heard:
                now_s = self.now()
                if decided and self._would_arm_blindly(now_s, command):
                    told = self._newest if self._untold else None
                    self._untold = False
                    self._held.pop(command.source, None)  # what was decided before holds no more
                    if told is not None and told.reason in HELD:
                        return told
                    return Applied(STOP, now_s, reason=Reason.STALE)
                if decided:
                    self._held[command.source] = command
                due = self._due(now_s, command.source) if decided else [command]
            self._send(due, now_s if decided else command.stamp_s)
        with self._heard:
            self._heard.wait_for(lambda: _results_from(self._newest, command, now_s), ANSWER_S)
            newest = self._newest
            if newest is None or now_s - newest.stamp_s > APPLIED.max_age_s:
                return Applied(STOP, now_s)
            self._untold = False
        if Source.POLICY == command.source == newest.source and newest.session != self._own:
            return Applied(STOP, newest.stamp_s, reason=Reason.REFUSED)  # somebody else drives
        return newest

    def wait(self, until_s: float) -> None:
        """Sleep until the robot's clock says so, or the robot is started anew and its clock with it."""
        epoch = self._epoch
        while self._epoch == epoch and (left_s := until_s - self.now()) > 0:
            time.sleep(min(left_s, NAP_S))

    def close(self) -> None:
        """Say stop, and fall silent; the robot runs on. May be called twice."""
        if self._closed.is_set():
            return
        self._closed.set()
        for thread in self._threads:
            thread.join()
        with self._sending:
            for _ in range(FAREWELL):
                self._send([Command(STOP, 0.0, released=True)], self._clock.now(time.monotonic()))

    def _run(self, work: Callable[[], None], key: str) -> None:
        while not self._closed.wait(POLL_S):
            try:
                with self.bus.boundary.guard(key):
                    work()
            except BusError:
                return  # the bus was closed first: whoever drives or reads hears of it

    def _listen(self) -> None:
        for received in self._results.poll():
            attachment = received.attachment
            if attachment is None:
                continue
            with self._heard:
                if not self._clock.hear(attachment.epoch, attachment.time_s, received.arrived_s):
                    continue
                if attachment.epoch != self._epoch:
                    self._begin_anew(attachment.epoch)
                self._note_stop(received.message)
                self._newest = received.message
                self._heard.notify_all()

    def _begin_anew(self, epoch: int) -> None:
        """Listen to a robot that was started. What was decided on another clock is not said to this one."""
        self._untold = self._epoch != NOBODY
        self._epoch = epoch
        self._held.clear()
        self._newest = None
        self._repeat_s = 0.0
        self._sensors.restart(epoch)
        self._states.restart(epoch)

    def _note_stop(self, applied: Applied) -> None:
        """Notice when the robot stops by itself. One that nobody has commanded yet has not moved since."""
        if applied.reason is Reason.NO_COMMAND:
            return
        if applied.reason not in HELD:
            self._untold = False
        elif self._newest is not None and self._newest.reason not in HELD:
            self._untold = True

    def _repeat(self) -> None:
        with self._sending:
            with self._heard:
                if not self._clock.known or (now_s := self._clock.now(time.monotonic())) < self._repeat_s:
                    return
                self._repeat_s = now_s + 1.0 / REPEAT_HZ
                due = self._due(now_s, *self._held)
            self._send(due, now_s)

    def _would_arm_blindly(self, now_s: float, command: Command) -> bool:
        """Whether this is neutral, and the robot has stopped, or may have lost patience since it was last heard."""
        newest = self._newest
        if newest is None or command.released or not is_neutral(command.twist):
            return False
        age_s = 0.0 if math.isnan(newest.command_age_s) else newest.command_age_s
        return self._untold or now_s - newest.stamp_s + age_s > self._patience_s

    def _due(self, now_s: float, *sources: Source) -> list[Command]:
        """The decisions that are still to be sent; lets go of what is too old."""
        due = []
        for command in [self._held[source] for source in sources]:
            if now_s - command.stamp_s > DECISION_S or self._would_arm_blindly(now_s, command):
                del self._held[command.source]
            else:
                due.append(command)
        return due

    def _send(self, commands: list[Command], time_s: float) -> None:
        for command in commands:
            put = self._publishers[command.source].put
            put(command.twist, time_s, answers=command.answers, released=command.released)


def _within(seconds: float, look: Callable[[], T]) -> T:
    """Look until something is there, for so long; returns what was found last."""
    deadline_s = time.monotonic() + seconds
    while not (found := look()) and time.monotonic() < deadline_s:
        time.sleep(POLL_S)
    return found


def _results_from(applied: Applied | None, command: Command, sent_s: float) -> bool:
    """Whether this was applied after the command came: the command itself, a hand that overruled it, or a stop."""
    if applied is None or applied.stamp_s < sent_s:
        return False
    return (
        applied.source is not Source.POLICY
        or command.source is not Source.POLICY
        or (applied.answers == command.answers)
    )
