"""A scripted person as a process: it sees the twin, hears the voice, and drives as a hand does, over teleop.

It stands for a person in tests of `lira teach`. It does not know what the novice will do, and expects that it goes on
as it does now for a moment, and then as the experts do. It is told which robot and which twin by its arguments: NAME
HOST:PORT WORLD LAYOUT SPEED SKILL SEED.
"""

import itertools
import math
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from msgspec import structs

from lira.fusion.experts.tasks import task_of
from lira.fusion.inference.threads import one_thread
from lira.fusion.methods.base import STAND, Choice, Expert, Policy, Proposal
from lira.fusion.methods.lira import in_consensus
from lira.fusion.preprocess import Features
from lira.fusion.teaching.teacher import TEACHERS, ScriptedTeacher
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import DECISION, SESSION, SIM_STATE
from lira.hal.messages import (
    Action,
    Applied,
    CourseState,
    Decision,
    Driver,
    OperatorRequest,
    Reason,
    Request,
    SessionState,
    Stage,
)
from lira.hal.profile import RobotProfile
from lira.hal.signals import stop_on_signal
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.foresight import Foresight
from lira.tools.joystick.client import TeleopClient
from lira.tools.runs.build import load_pair

ACTIVE = 0.4  # so far from its cruise an expert reacts to something
READY = "the scripted person is there"
SEND_HZ = 30.0
ANSWER_S = 60.0
NEW_SHARE = 0.2  # of the newest look in how long a look is expected to take
ZEROS_S = 0.5
STOPPED = frozenset({Reason.STALE, Reason.NEUTRAL_FIRST, Reason.REFUSED})


class Controls(Protocol):
    """What the person has in hand: teleop itself, a pad, or a page. `action` None: hands off."""

    action: Action | None

    def ask(self, request: Request) -> None:
        """Press the button for it."""


class Thumb:
    """Sends what the person holds by teleop itself, at the rate of a pad, from a thread."""

    def __init__(self, client: TeleopClient, speed: float) -> None:
        self._client, self._period_s = client, 1.0 / (SEND_HZ * speed)
        self._zeros_s = ZEROS_S / speed
        self._applied: Applied | None = None
        self.action: Action | None = None

    def ask(self, request: Request) -> None:
        """Ask whoever learns."""
        self._client.ask(OperatorRequest(request), time.monotonic())

    def run(self, stop: threading.Event) -> None:
        """Until told to stop; then let go."""
        off_s = look_s = -1.0
        while not stop.wait(self._period_s):
            self._applied = self._client.listen() or self._applied
            now_s, action = time.monotonic(), self.action
            stopped = self._applied is not None and self._applied.reason in STOPPED
            if stopped and action is None and now_s > look_s:  # as the voice says: press and release the dead-man
                off_s, look_s = now_s + self._zeros_s, now_s + 4 * self._zeros_s
            if action is not None:
                off_s = now_s + self._zeros_s
                self._client.drive((0.0, 0.0) if stopped else action, released=False, local_s=now_s)
            elif now_s < off_s:
                self._client.drive((0.0, 0.0), released=True, local_s=now_s)


class Person:
    """What the hand does, by what is seen: a decision a period. Pure but for what the teacher remembers."""

    def __init__(self, teacher: ScriptedTeacher, experts: Sequence[Expert]) -> None:
        self._teacher, self._experts = teacher, experts
        self._lap: tuple[int, int, Stage] | None = None

    def act(self, state: CourseState, decision: Decision | None, session: SessionState) -> Action | None:
        """The action, or None with hands off."""
        lap = session.layout, session.laps, session.stage
        if lap != self._lap:
            self._lap = lap
            self._teacher.reset(session.layout)
        if session.stage is Stage.VERDICT:
            return STAND  # a hand on the controls goes on
        if state.collided or state.lost or state.finished or session.stage in (Stage.PROVING, Stage.EXAM, Stage.OVER):
            return None
        if session.stage in (Stage.PRACTICE, Stage.READY) or decision is None:
            return self._teach(state, None)
        return self._teach(state, decision)

    def close(self) -> None:
        """Look no further ahead."""
        self._teacher.close()

    def _teach(self, state: CourseState, decision: Decision | None) -> Action | None:
        """As the teacher does. What would drive is expected to go on as it is."""
        if decision is None or decision.driver == Driver.NOBODY:
            answer = self._teacher.act(state, Proposal(Features(), Choice(Driver.NOBODY, STAND)), None)
        else:
            would = decision.novice if decision.driver == Driver.HUMAN else decision.executed
            proposal = Proposal(Features(), Choice(Driver.NOVICE, would, call=decision.call))
            answer = self._teacher.act(state, proposal, self._expected(would))
        return None if isinstance(answer, str) else answer

    def _expected(self, action: Action) -> Policy:
        """The action once more, then whichever expert sees something to react to, else the first.

        Who expects that a novice goes on as it is for longer takes over more often, and where nothing was wrong: the
        labels of that teach the novice less.
        """
        looks = itertools.count()

        def act(features: Features) -> Action:
            if next(looks) == 0:
                return action
            answers = [(expert.act(features), expert.cruise) for expert in self._experts]
            return next((a for a, idle in reversed(answers) if not in_consensus([a, idle], ACTIVE)), answers[0][0])

        return act


def ahead(state: CourseState, lag_s: float) -> CourseState:
    """Where the robot is when what is decided now takes hold: a person reckons with that."""
    way_m, yaw_rad = state.linear_m_s * lag_s, state.yaw_rad + 0.5 * state.angular_rad_s * lag_s
    return replace(
        state,
        x_m=state.x_m + way_m * math.cos(yaw_rad),
        y_m=state.y_m + way_m * math.sin(yaw_rad),
        yaw_rad=state.yaw_rad + state.angular_rad_s * lag_s,
    )


def live(controls: Controls, watch: Bus, person: Person, period_s: float, speed: float, stop: threading.Event) -> None:
    """Look and act, a period at a time, until the session is over; end it once it has passed."""
    states, decisions, sessions = watch.reader(SIM_STATE), watch.reader(DECISION), watch.reader(SESSION)
    asked, proofs, thinks_s = False, 0, 0.0
    while not stop.wait(period_s / speed):
        state, session = states.newest(), sessions.newest()
        decision = decisions.newest()
        if state is None or session is None:
            continue
        told = session.message
        if told.stage is Stage.OVER:
            return
        fresh = decision is not None and time.monotonic() - decision.arrived_s < DECISION.max_age_s
        if told.stage is Stage.TEACHING and told.passed > proofs:  # a lap went well: can it alone?
            proofs = told.passed
            controls.ask(Request.PROVE)
        if told.stage is Stage.VERDICT and told.converged:
            if not asked:
                controls.ask(Request.FINISH)
            asked, controls.action = True, None
            continue
        began_s = time.monotonic()
        lag_s = (began_s - state.arrived_s + thinks_s) * speed + period_s / 2
        heard = decision.message if fresh and decision is not None else None
        controls.action = person.act(ahead(state.message, lag_s), heard, told)
        thinks_s += NEW_SHARE * (time.monotonic() - began_s - thinks_s)


def person_for(profile: RobotProfile, world: str, layout: int, skill: str, seed: int) -> Person:
    """A person who teaches in this world."""
    settings = structs.replace(TEACHERS[skill], style="proportional")
    foresight = Foresight(profile, load_world(world), layout)
    experts = [expert for _, expert in load_pair(profile, task_of(world))]
    return Person(ScriptedTeacher(foresight, profile, settings, seed), experts)


def main() -> int:
    """Teach until the session passed, then end it."""
    one_thread()
    name, endpoint, world, layout, speed, skill, seed = sys.argv[1:8]
    bus, watch = Bus(name, connect=endpoint), Bus(name, connect=endpoint, watch=True)
    client = TeleopClient(bus, watch, ANSWER_S)
    person, thumb = person_for(client.profile, world, int(layout), skill, int(seed)), Thumb(client, float(speed))
    with stop_on_signal() as stop:
        thread = threading.Thread(target=thumb.run, args=[stop], name="thumb")
        thread.start()
        print(READY, flush=True)
        try:
            live(thumb, watch, person, client.profile.period_s, float(speed), stop)
        finally:
            stop.set()
            thread.join()
            person.close()
            watch.close()
            bus.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
