"""What the page shows now, as one message. Pure: made from a view alone, for whoever looks."""

import math

import msgspec

from lira.hal.messages import Action, Driver, LaserScan
from lira.tools.operator.view import STALE_S, View, battery_share, beams_ahead
from lira.tools.operator.voice import progress_words, speak, verdict

BEAMS = 180  # as many as a fan on a small screen can show


class Actor(msgspec.Struct, frozen=True):
    """One who proposes: an expert with its activation, the novice, the person, or what drives."""

    name: str
    action: Action
    activation: float | None = None
    active: bool = False


class Counts(msgspec.Struct, frozen=True):
    """What was taught so far."""

    human_labels: int
    expert_labels: int
    demonstration: int
    interventions: int
    calls: int
    training_steps: int
    lap: int
    phase: str


class Session(msgspec.Struct, frozen=True):
    """How a session of teaching goes."""

    stage: str
    layout: int
    words: str
    curve: tuple[float, ...] = ()


class Frame(msgspec.Struct, frozen=True):
    """One moment. What is old is left out: it is null, not shown as new.

    `time` is the server's clock in seconds; a page that drives sends it back, so that the age of what it says is known.
    `scan` holds (angle in rad, distance in m) counter-clockwise, `pose` is (x, y, yaw): the truth if a twin tells it.
    """

    time: float
    situation: str
    urgency: str
    who: str
    why: str
    now: str
    estop: bool
    paused: bool
    seat: str  # who has the page's controls: "yours", "free" or "taken"
    hand: str | None
    verdict: str = ""
    accepted: bool | None = None
    link_ms: float | None = None
    waiting: bool = False
    speed: tuple[float, float] | None = None
    battery_v: float | None = None
    battery_share: float | None = None
    threshold: float = 0.0
    driver: str = ""
    actors: tuple[Actor, ...] = ()
    counts: Counts | None = None
    session: Session | None = None
    scan: tuple[tuple[float, float], ...] | None = None
    pose: tuple[float, float, float] | None = None


def frame_of(view: View, *, time_s: float, seat: str, language: str) -> Frame:
    """The frame for one page. Raises `ConfigError` for a language that there is none of."""
    voice = speak(view, language)
    words, accepted = verdict(view)
    decision, battery = view.deciding, view.battery
    actors: list[Actor] = []
    if decision is not None:
        actors += [Actor(e.name, e.action, e.activation, e.active) for e in decision.experts]
        actors.append(Actor(Driver.NOVICE, decision.novice))
        if decision.human is not None:
            actors.append(Actor(Driver.HUMAN, decision.human))
        actors.append(Actor("drives", decision.executed))
    return Frame(
        time=time_s,
        situation=voice.situation,
        urgency=voice.urgency,
        who=voice.who,
        why=voice.why,
        now=voice.now,
        estop=view.estop,
        paused=view.paused,
        seat=seat,
        hand=view.hand,
        verdict=words,
        accepted=accepted,
        link_ms=1e3 * view.link_age_s if view.linked else None,
        waiting=view.waiting,
        speed=None if view.odom is None or not view.linked else (view.odom.linear_m_s, view.odom.angular_rad_s),
        battery_v=None if battery is None else battery.voltage_v,
        battery_share=None if battery is None else battery_share(battery),
        threshold=0.0 if decision is None else decision.threshold,
        driver="" if decision is None else decision.driver,
        actors=tuple(actors),
        counts=counts_of(view),
        session=None
        if view.teaching is None
        else Session(view.teaching.stage, view.teaching.layout, progress_words(view.teaching), view.teaching.curve),
        scan=None if view.scan is None or view.scan_age_s > STALE_S else points_of(view.scan, view),
        pose=pose_of(view),
    )


def counts_of(view: View) -> Counts | None:
    """The counts of the newest decision, however old: what was taught stays taught."""
    decision = view.decision
    if decision is None:
        return None
    labels = decision.labels
    return Counts(
        human_labels=labels.stored_human,
        expert_labels=labels.stored_expert,
        demonstration=labels.demonstration,
        interventions=decision.interventions,
        calls=decision.calls,
        training_steps=decision.training_steps,
        lap=decision.lap,
        phase=decision.phase,
    )


def points_of(scan: LaserScan, view: View) -> tuple[tuple[float, float], ...]:
    """The beams ahead, no more of them than can be told apart."""
    beams = beams_ahead(scan, view.fov_rad, view.max_range_m)
    step = max(1, math.ceil(len(beams) / BEAMS))
    return tuple((round(angle, 3), round(distance_m, 3)) for angle, distance_m in beams[::step])


def pose_of(view: View) -> tuple[float, float, float] | None:
    """Where the robot is: what only a twin knows, else what it has counted itself."""
    if view.course is not None:
        return view.course.x_m, view.course.y_m, view.course.yaw_rad
    if view.odom is not None and view.linked:
        return view.odom.x_m, view.odom.y_m, view.odom.yaw_rad
    return None
