"""What is said about driving and learning: who drove, why, and what was learned."""

from dataclasses import dataclass
from enum import StrEnum

from lira.hal.messages.values import Action


class Driver(StrEnum):
    """Who may drive a step, or give a label, beside the experts, which go by names of their own."""

    HUMAN = "human"
    NOVICE = "novice"
    MEAN = "mean"  # of the experts that agree
    SHIELD = "shield"  # a turn of the novice's that would have touched something, made clear
    NOBODY = "none"  # it stands and waits for a person


class Call(StrEnum):
    """How the human is called: to look, or to answer."""

    NONE = "none"
    ATTENTION = "attention"
    FEEDBACK = "feedback"


class Phase(StrEnum):
    """Where in a session a step or a lap belongs."""

    TRAIN = "train"
    PROVE = "prove"  # the novice alone, where it was taught
    UNSEEN = "unseen"  # alone, where it was not


class Stage(StrEnum):
    """What a person's session is at (`SessionState`)."""

    PRACTICE = "practice"  # the hand gets to know the robot; nothing is learned
    READY = "ready"  # nothing drives off before a hand was there
    DEMONSTRATION = "demonstration"
    TEACHING = "teaching"
    PROVING = "proving"  # the novice alone; a twin tells how it went
    EXAM = "exam"  # the same on layouts that it has not seen, in a twin of its own
    JUDGING = "judging"  # the novice alone; the person says how it went
    VERDICT = "verdict"  # stop, or go on?
    OVER = "over"


@dataclass(frozen=True, slots=True)
class SessionState:
    """How a person's session of teaching goes (`lira/session`): what to do next, and whether it is good already.

    `person` is who teaches and `layout` the twin's, as it is now. Counts go on from day to day: `laps` (of teaching),
    `passed`, `collisions` and `lost` too. `alone` is the share of steps since the demonstration in which no
    person drove, `curve` the same of each lap. Of `shown` proving laps the novice has passed `proven`. `words` is the
    newest verdict, and `converged` whether it is that the novice passed.
    """

    stamp_s: float
    stage: Stage
    person: str = ""
    layout: int = 0
    laps: int = 0
    passed: int = 0
    collisions: int = 0
    lost: int = 0
    labels: int = 0
    calls: int = 0
    answered: int = 0
    alone: float = 0.0
    curve: tuple[float, ...] = ()
    proven: int = 0
    shown: int = 0
    words: str = ""
    converged: bool = False


@dataclass(frozen=True, slots=True)
class ExpertView:
    """One expert at one decision: its action, its activation A^i (eq. 1) and whether that made it active."""

    name: str
    action: Action
    activation: float
    active: bool


@dataclass(frozen=True, slots=True)
class FeatureArray:
    """What a method sees of one sensor, as labels keep it (`fusion.preprocess.Modality.keep`)."""

    name: str
    data: bytes


class CallName(StrEnum):
    """What a method was asked (`MethodCall`): the functions of `fusion.methods.base.Method`, and its life's ends."""

    BEGIN = "begin"
    REMEMBER = "remember"  # a label from before
    UPDATE = "update"
    PROPOSE = "propose"
    CHOOSE = "choose"
    LEARN = "learn"
    ALONE = "alone"
    RESET = "reset"
    END = "end"


@dataclass(frozen=True, slots=True)
class MethodCall:
    """One call of a method: what it got, and what came of it (`outcome`, JSON).

    `target` is 0 for the method itself, and n for the n-th driver that its `alone` gave. `argument` is the settings as
    JSON (begin), a label's source (remember), an expert (choose) or a phase (alone). `action` is the human's (learn) or
    a label's.
    """

    name: CallName
    target: int = 0
    time_s: float = 0.0
    argument: str = ""
    action: Action | None = None
    features: tuple[FeatureArray, ...] = ()
    outcome: str = ""


@dataclass(frozen=True, slots=True)
class MethodCalls:
    """The calls of a method since the last message, in order (`lira/method`): enough to go through it again."""

    stamp_s: float
    calls: tuple[MethodCall, ...]


@dataclass(frozen=True, slots=True)
class LabelCounts:
    """Labels by source; `given` is before the redundancy filter, `stored` after it."""

    given_human: int = 0
    given_expert: int = 0
    stored_human: int = 0
    stored_expert: int = 0
    demonstration: int = 0  # the human's labels before the first training step, counted apart


@dataclass(frozen=True, slots=True)
class Decision:
    """What was decided on one observation, by whom and why (`lira/decision`).

    `driver` is a `Driver`, or the name of the expert or of whatever else drove; `executed` is its action, before any
    slow-down; `phase` and `lap` say where in a session this step belongs.
    """

    stamp_s: float
    observation: int
    driver: str
    call: Call
    executed: Action
    novice: Action
    human: Action | None
    experts: tuple[ExpertView, ...]
    threshold: float
    labels: LabelCounts
    training_steps: int
    interventions: int
    calls: int  # rising edges of attention and feedback calls
    phase: Phase = Phase.TRAIN
    lap: int = 0
