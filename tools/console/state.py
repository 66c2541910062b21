"""Everything the console shows, as one value. Pure: times come in as arguments."""

from dataclasses import dataclass, field

from lira.hal.bus.topics import OPERATOR_ANSWER
from lira.hal.messages import (
    Applied,
    BatteryState,
    ByteArray,
    Decision,
    LaserScan,
    Odometry,
    OperatorAnswer,
    Request,
)
from lira.tools.joystick.deadman import State

STALE_S = 1.0
EMPTY_V, LOW_V, FULL_V = 10.2, 10.8, 12.6  # three lithium cells


@dataclass(frozen=True, slots=True)
class View:
    """What is known now. A part is None until it was heard; ages are in seconds since it was.

    `camera` is RGB, uint8 [height, width, 3]. `hand` is the keyboard's, None without one. `answer` is whoever's who
    drives and learns; `unanswered` is the keyboard's request that nobody answered. `confirmed`: the robot has answered
    that the emergency stop holds which was pressed here.
    """

    robot: str
    scan: LaserScan | None = None
    scan_age_s: float = float("inf")
    camera: ByteArray | None = None
    camera_age_s: float = float("inf")
    odom: Odometry | None = None
    applied: Applied | None = None
    link_age_s: float = float("inf")
    decision: Decision | None = None
    decision_age_s: float = float("inf")
    battery: BatteryState | None = None
    answer: OperatorAnswer | None = None
    answer_age_s: float = float("inf")
    unanswered: Request | None = None
    estop: bool = False
    confirmed: bool = False
    hand: State | None = None
    fov_rad: float = 2.269
    max_range_m: float = 4.0
    limits: tuple[float, float] = field(default=(1.0, 1.0))

    @property
    def deciding(self) -> Decision | None:
        """The decision that holds now: None if nobody decides any more. Its counts outlive it."""
        return self.decision if self.decision_age_s < STALE_S else None

    @property
    def answering(self) -> OperatorAnswer | None:
        """The newest answer if somebody still takes requests."""
        return self.answer if self.answer_age_s <= OPERATOR_ANSWER.max_age_s else None

    @property
    def paused(self) -> bool:
        """Whether driving and learning wait for a person."""
        return self.answering is not None and self.answering.paused

    @property
    def call(self) -> str:
        """The call that is on now, or "none"."""
        return "none" if self.deciding is None else self.deciding.call


def driver_words(view: View) -> tuple[str, str]:
    """Who drives, and why, each in a few words."""
    if view.estop:
        release = "release: START held on the pad, or F1 here"
        return "EMERGENCY STOP", f"confirmed by the robot; {release}" if view.confirmed else release
    if view.applied is None or view.link_age_s > STALE_S:
        return "NO LINK", "the robot has not been heard; it stops by itself"
    if view.applied.source == "teleop":
        why = "the dead-man is held" + ("; paused: nothing is learned" if view.paused else "")
        return "HUMAN", _named(view.applied, why)
    if view.paused:
        return "PAUSED", "it stands and learns nothing; P, or square on the pad, goes on"
    if view.applied.source == "none":
        return "STANDS", REASONS.get(view.applied.reason, view.applied.reason)
    who, why = policy_words(view.deciding)
    return who, _named(view.applied, why)


def _named(applied: Applied, why: str) -> str:
    """Why, with the name of who commands where keys tell it."""
    return f"{applied.commander} drives: {why}" if applied.commander else why


REASONS = {
    "no_command": "nobody has commanded yet",
    "stale": "who drove went silent",
    "neutral_first": "waits for a neutral command",
    "refused": "refused a command",
    "estop": "the emergency stop is pressed",
    "obstacle": "something is in the way",
    "ok": "told to stand",
}


def operator_words(view: View) -> tuple[str, bool | None]:
    """What became of the newest request in a few words, and whether it was done; None if there was none."""
    if view.unanswered is not None:
        return f"nobody answers to '{view.unanswered}': does lira fusion run?", False
    if view.answering is None:
        return "nobody takes requests: start lira fusion", None
    if not view.answering.count:
        return "no request yet", None
    return view.answering.words, view.answering.accepted


def policy_words(decision: Decision | None) -> tuple[str, str]:
    """Which policy drives, and why it is that one."""
    if decision is None:
        return "POLICY", "it does not say how it decides"
    if decision.driver == "shield":
        stands = decision.call == "feedback"
        return "SHIELD", "no turn is clear: it stands and asks you" if stands else "the novice would touch something"
    if decision.call == "feedback":
        return decision.driver.upper(), "experts disagree: it drives slowly and asks you"
    if decision.driver == "novice":
        return "NOVICE", "no expert is active"
    if decision.driver == "mean":
        return "EXPERTS' MEAN", "active experts agree"
    if decision.driver == "human":
        return "WAITS FOR YOU", "demonstrate first: it has learned nothing yet"
    return f"EXPERT {decision.driver.upper()}", "it alone is active"


def battery_share(battery: BatteryState) -> float:
    """How full, in [0, 1], by voltage."""
    return min(1.0, max(0.0, (battery.voltage_v - EMPTY_V) / (FULL_V - EMPTY_V)))
