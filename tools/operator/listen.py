"""Hears the newest of everything on a watching bus, as a view."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.services import LOCKSTEP, Info
from lira.hal.bus.topics import APPLIED, BATTERY, CAMERA, DECISION, ODOM, OPERATOR_ANSWER, SCAN, SESSION, SIM_STATE
from lira.hal.messages import Applied, Reason
from lira.tools.operator.view import View
from lira.tools.operator.voice import explain

REPEATED_S = 3.0  # a robot in lockstep says again what it senses once a second, to whoever may drive it by now
M = TypeVar("M")


class Ears:
    """Keeps the newest; what comes between two looks is dropped. `info` is what the robot said of itself."""

    def __init__(self, watch: Bus, info: Info) -> None:
        self._scan, self._camera = watch.reader(SCAN), watch.reader(CAMERA)
        self._odom, self._applied = watch.reader(ODOM), watch.reader(APPLIED)
        self._decision, self._battery = watch.reader(DECISION), watch.reader(BATTERY)
        self._answer, self._truth = watch.reader(OPERATOR_ANSWER), watch.reader(SIM_STATE)
        self._session = watch.reader(SESSION)
        self._answered, self._verdict_s = 0, -math.inf
        self._in_lockstep = info.mode == LOCKSTEP
        features = info.profile.features
        self._view = View(
            watch.robot,
            fov_rad=features.fov_rad,
            max_range_m=features.max_range_m,
        )

    def look(self) -> View:
        """The view now."""
        scan, odom, applied = self._scan.newest(), self._odom.newest(), self._applied.newest()
        decision, battery, answer = self._decision.newest(), self._battery.newest(), self._answer.newest()
        truth, picture, session = self._truth.newest(), self._camera.newest(), self._session.newest()
        if answer is not None and answer.message.count != self._answered:
            self._answered, self._verdict_s = answer.message.count, answer.arrived_s
        now_s = time.monotonic()
        return replace(
            self._view,
            scan=_message(scan),
            scan_age_s=_age_s(scan, now_s),
            picture=_message(picture),
            picture_age_s=_age_s(picture, now_s),
            odom=_message(odom),
            truth=_message(truth),
            truth_age_s=_age_s(truth, now_s),
            applied=_message(applied),
            link_age_s=_age_s(applied, now_s),
            decision=_message(decision),
            decision_age_s=_age_s(decision, now_s),
            session=_message(session),
            session_age_s=_age_s(session, now_s),
            battery=_message(battery),
            answer=_message(answer),
            answer_age_s=_age_s(answer, now_s),
            verdict_age_s=now_s - self._verdict_s,
            estop=applied is not None and applied.message.reason is Reason.ESTOP,
            lockstep=self._in_lockstep and _age_s(odom, now_s) <= REPEATED_S,
        )


def explaining(bus: Bus) -> Callable[[Applied], str]:
    """What puts into words why the robot stands for whoever drives on a bus, or that somebody else drives it."""
    wheels = bus.reader(APPLIED)

    def explained(applied: Applied) -> str:
        newest = wheels.newest()
        fresh = newest is not None and time.monotonic() - newest.arrived_s <= APPLIED.max_age_s
        return explain(applied, _message(newest) if fresh else None)

    return explained


def _message(received: Received[M] | None) -> M | None:
    return None if received is None else received.message


def _age_s(received: Received[M] | None, now_s: float) -> float:
    return math.inf if received is None else now_s - received.arrived_s
