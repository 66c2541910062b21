"""What a person at the robot is faced with, as one of few situations. Pure, and one place for all screens and pads.

The first of these rules that holds decides: who must act comes before who drives.

| what is so | situation |
|---|---|
| the emergency stop is pressed | estop, estop_confirmed |
| nothing is heard of the wheels | no_link; of a robot in lockstep, which is there: lockstep |
| commands from here are refused, and somebody else drives | other |
| the dead-man is held | person; slowly: person_slow; paused: person_paused |
| a request paused it | paused |
| a session is at a stage that is the person's | practice, ready, judging, verdict, passed |
| a session proves on a twin | proving, exam |
| a twin's lap is over | collided, strayed, finished |
| the governor lets nothing through | its reason |
| the policy stands and waits for a person | waits, unknown |
| experts disagree | disagree |
| a policy drives | who it is |
"""

from enum import StrEnum

from lira.hal.messages import Applied, Call, Decision, Driver, Phase, Reason, Source, Stage
from lira.tools.operator.view import View

HAND_DRIVES = "driving"
SLOW = 0.6  # of full speed: who drives so, all the time, teaches slowness


class Situation(StrEnum):
    """What is to be said; the words are in `words/`."""

    ESTOP = "estop"
    ESTOP_CONFIRMED = "estop_confirmed"
    NO_LINK = "no_link"
    LOCKSTEP = "lockstep"
    OTHER = "other"
    PERSON = "person"
    PERSON_SLOW = "person_slow"
    PERSON_PAUSED = "person_paused"
    PAUSED = "paused"
    PRACTICE = "practice"
    READY = "ready"
    JUDGING = "judging"
    VERDICT = "verdict"
    PASSED = "passed"
    COLLIDED = "collided"
    STRAYED = "strayed"
    FINISHED = "finished"
    DEVICE_LOST = "device_lost"
    STALE = "stale"
    NEUTRAL_FIRST = "neutral_first"
    NEUTRAL_HELD = "neutral_held"
    REFUSED = "refused"
    OBSTACLE = "obstacle"
    NO_COMMAND = "no_command"
    TOLD_TO_STAND = "told_to_stand"
    WAITS = "waits"
    UNKNOWN = "unknown"
    DISAGREE = "disagree"
    ONE_EXPERT = "one_expert"
    SHIELD = "shield"
    SHIELD_STANDS = "shield_stands"
    PROVING = "proving"
    EXAM = "exam"
    NOVICE = "novice"
    MEAN = "mean"
    EXPERT = "expert"
    POLICY = "policy"


class Urgency(StrEnum):
    """How loud it is, the loudest last."""

    IDLE = "idle"  # it stands as it was told
    CALM = "calm"  # somebody drives
    WATCH = "watch"  # look at the robot
    ASK = "ask"  # your decision
    NEED = "need"  # it stands, and goes on only if you act
    ALARM = "alarm"  # the emergency stop is pressed, or nothing is known of the robot


# Corners of the sign beside the words, so that nobody depends on colours; what needs nobody has none.
CORNERS = {Urgency.WATCH: 3, Urgency.ASK: 4, Urgency.NEED: 4, Urgency.ALARM: 8}

_S = Situation
URGENCY: dict[Situation, Urgency] = {
    **dict.fromkeys(Situation, Urgency.CALM),
    **dict.fromkeys((_S.ESTOP, _S.ESTOP_CONFIRMED, _S.NO_LINK), Urgency.ALARM),
    **dict.fromkeys((_S.STALE, _S.NEUTRAL_FIRST, _S.NEUTRAL_HELD, _S.REFUSED, _S.DEVICE_LOST), Urgency.NEED),
    **dict.fromkeys((_S.COLLIDED, _S.STRAYED, _S.WAITS, _S.OBSTACLE, _S.UNKNOWN, _S.SHIELD_STANDS), Urgency.NEED),
    **dict.fromkeys((_S.DISAGREE, _S.VERDICT, _S.PASSED, _S.READY), Urgency.ASK),
    **dict.fromkeys((_S.ONE_EXPERT, _S.SHIELD, _S.JUDGING, _S.OTHER), Urgency.WATCH),
    **dict.fromkeys((_S.PAUSED, _S.FINISHED, _S.NO_COMMAND, _S.TOLD_TO_STAND, _S.PRACTICE, _S.LOCKSTEP), Urgency.IDLE),
}

STANDING: dict[Reason, Situation] = {
    Reason.OK: _S.TOLD_TO_STAND,
    Reason.NO_COMMAND: _S.NO_COMMAND,
    Reason.STALE: _S.STALE,
    Reason.NEUTRAL_FIRST: _S.NEUTRAL_FIRST,
    Reason.REFUSED: _S.REFUSED,
    Reason.OBSTACLE: _S.OBSTACLE,
    Reason.ESTOP: _S.ESTOP,
}


# A session at one of these says by itself what is to be done, and puts a twin's robot back after a lap.
STAGES: dict[Stage, Situation] = {
    Stage.PRACTICE: _S.PRACTICE,
    Stage.READY: _S.READY,
    Stage.JUDGING: _S.JUDGING,
    Stage.PROVING: _S.PROVING,
    Stage.EXAM: _S.EXAM,
    Stage.VERDICT: _S.VERDICT,
}


def situation_of(view: View) -> Situation:
    """Which situation this is, by the table above."""
    if view.estop:
        return _S.ESTOP_CONFIRMED if view.confirmed else _S.ESTOP
    applied = view.applied
    if applied is None or not view.linked:
        return _S.LOCKSTEP if view.waiting else _S.NO_LINK
    if view.other:
        return _S.OTHER
    if applied.source is Source.TELEOP:
        return _by_hand(view)
    if view.paused:
        return _S.PAUSED
    standing = standing_of(applied, view.hand, decides=view.decision is not None)
    stage = None if view.teaching is None else STAGES.get(view.teaching.stage)
    if stage is _S.VERDICT and view.teaching is not None and view.teaching.converged:
        return _S.PASSED
    if stage is not None:
        return standing or stage if stage is _S.JUDGING else stage
    over = _lap_over(view) if view.teaching is None else None  # a session begins the next lap by itself
    return over or standing or _driving(view.deciding)


def _by_hand(view: View) -> Situation:
    """What the hand on the controls does to what is learned."""
    if view.teaching is not None and view.teaching.stage is Stage.PRACTICE:
        return _S.PRACTICE
    return _S.PERSON_PAUSED if view.paused else _S.PERSON_SLOW if _is_slow(view) else _S.PERSON


def lost_devices(applied: Applied) -> tuple[str, ...]:
    """Which devices the governor misses, by name."""
    return tuple(clamp.removeprefix("no_") for clamp in applied.clamps if clamp.startswith("no_"))


def _is_slow(view: View) -> bool:
    """Whether the hand drives straight on at part of the speed that the experts drive at."""
    decision = view.deciding
    if decision is None or decision.human is None or not decision.experts:
        return False
    fastest = max(expert.action[0] for expert in decision.experts)
    return 0.0 < decision.human[0] < SLOW * fastest


def _lap_over(view: View) -> Situation | None:
    truth = view.course
    if truth is None:
        return None
    ends = ((truth.collided, _S.COLLIDED), (truth.lost, _S.STRAYED), (truth.finished, _S.FINISHED))
    return next((situation for over, situation in ends if over), None)


def standing_of(applied: Applied, hand: str | None = None, *, decides: bool = True) -> Situation | None:
    """Why the governor lets nothing through, None if it does. `decides`: somebody was heard who makes decisions."""
    if applied.source is not Source.NONE and applied.reason is Reason.OK:
        return None
    if applied.reason is Reason.STALE and lost_devices(applied):
        return _S.DEVICE_LOST
    if applied.reason is Reason.STALE and not decides:
        return _S.NO_COMMAND  # a hand has let go, and there is nobody to go on
    if applied.reason is Reason.NEUTRAL_FIRST and hand == HAND_DRIVES:
        return _S.NEUTRAL_HELD
    return STANDING[applied.reason]


def _driving(decision: Decision | None) -> Situation:
    """Which policy drives, and why it is that one."""
    if decision is None:
        return _S.POLICY
    if decision.driver == Driver.SHIELD:
        return _S.SHIELD_STANDS if decision.call == Call.FEEDBACK else _S.SHIELD
    if decision.call == Call.FEEDBACK:
        if decision.driver == Driver.NOBODY:
            return _S.WAITS if decision.training_steps == 0 and not decision.labels.demonstration else _S.UNKNOWN
        return _S.DISAGREE
    if decision.phase in (Phase.PROVE, Phase.UNSEEN):
        return _S.PROVING
    if decision.driver in (Driver.NOVICE, Driver.MEAN):
        return Situation(decision.driver)
    return _S.ONE_EXPERT if decision.call == Call.ATTENTION else _S.EXPERT
