"""The rule for arming: what happens to the governor, and when the wheels may turn. A table; nothing else arms.

In words: only a neutral command of whoever is in charge arms, only an armed robot moves, whatever goes wrong stops it,
a lost device holds it until it is back, the emergency stop until it is released, and then a neutral command must come.
"""

from enum import StrEnum

from lira.hal.messages import Reason


class State(StrEnum):
    """Whether motion is allowed."""

    DISARMED = "disarmed"  # nobody has commanded, or the commander left
    ARMED = "armed"
    STOPPED = "stopped"  # something went wrong
    LOST = "lost"  # a device that it needs is lost
    EMERGENCY = "emergency"  # somebody pressed the emergency stop


class Event(StrEnum):
    """What can happen to the governor.

    What it makes up itself (a zero by limits, protective field or time-out) is no event, and neither is a zero of a
    hand that has let go: the one is nobody's decision, the other not about driving.
    """

    NEUTRAL = "neutral"  # who is in charge commands zero
    MOTION = "motion"  # who is in charge commands motion
    RESUMED = "resumed"  # a hand that a stop cut off commands motion again, and was not at zero in between
    EXPIRED = "expired"  # who was in charge went silent
    BROKEN = "broken"  # a command that is not finite
    IGNORED = "ignored"  # a command that came late, out of order or from somebody else
    HALTED = "halted"  # the robot is being shut down, or the commander left
    LOST = "lost"  # a device is lost, or was since the last look
    FOUND = "found"  # all devices are back
    PRESSED = "pressed"  # the emergency stop
    RELEASED = "released"  # the emergency stop


_D, _A, _S, _L, _E = State.DISARMED, State.ARMED, State.STOPPED, State.LOST, State.EMERGENCY
TRANSITIONS: dict[tuple[State, Event], tuple[State, Reason]] = {
    (_D, Event.NEUTRAL): (_A, Reason.OK),
    (_D, Event.MOTION): (_D, Reason.NEUTRAL_FIRST),
    (_D, Event.RESUMED): (_D, Reason.NEUTRAL_FIRST),
    (_D, Event.EXPIRED): (_D, Reason.STALE),
    (_D, Event.BROKEN): (_D, Reason.REFUSED),
    (_D, Event.IGNORED): (_D, Reason.REFUSED),
    (_D, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_D, Event.LOST): (_L, Reason.STALE),
    (_D, Event.FOUND): (_D, Reason.NEUTRAL_FIRST),
    (_D, Event.PRESSED): (_E, Reason.ESTOP),
    (_D, Event.RELEASED): (_D, Reason.NEUTRAL_FIRST),
    (_A, Event.NEUTRAL): (_A, Reason.OK),
    (_A, Event.MOTION): (_A, Reason.OK),
    (_A, Event.RESUMED): (_S, Reason.NEUTRAL_FIRST),
    (_A, Event.EXPIRED): (_S, Reason.STALE),
    (_A, Event.BROKEN): (_S, Reason.REFUSED),
    (_A, Event.IGNORED): (_A, Reason.OK),
    (_A, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_A, Event.LOST): (_L, Reason.STALE),
    (_A, Event.FOUND): (_A, Reason.OK),
    (_A, Event.PRESSED): (_E, Reason.ESTOP),
    (_A, Event.RELEASED): (_A, Reason.OK),
    (_S, Event.NEUTRAL): (_A, Reason.OK),
    (_S, Event.MOTION): (_S, Reason.NEUTRAL_FIRST),
    (_S, Event.RESUMED): (_S, Reason.NEUTRAL_FIRST),
    (_S, Event.EXPIRED): (_S, Reason.STALE),
    (_S, Event.BROKEN): (_S, Reason.REFUSED),
    (_S, Event.IGNORED): (_S, Reason.REFUSED),
    (_S, Event.HALTED): (_D, Reason.NO_COMMAND),
    (_S, Event.LOST): (_L, Reason.STALE),
    (_S, Event.FOUND): (_S, Reason.NEUTRAL_FIRST),
    (_S, Event.PRESSED): (_E, Reason.ESTOP),
    (_S, Event.RELEASED): (_S, Reason.NEUTRAL_FIRST),
    (_L, Event.NEUTRAL): (_L, Reason.STALE),
    (_L, Event.MOTION): (_L, Reason.STALE),
    (_L, Event.RESUMED): (_L, Reason.STALE),
    (_L, Event.EXPIRED): (_L, Reason.STALE),
    (_L, Event.BROKEN): (_L, Reason.STALE),
    (_L, Event.IGNORED): (_L, Reason.STALE),
    (_L, Event.HALTED): (_L, Reason.STALE),
    (_L, Event.LOST): (_L, Reason.STALE),
    (_L, Event.FOUND): (_S, Reason.NEUTRAL_FIRST),
    (_L, Event.PRESSED): (_E, Reason.ESTOP),
    (_L, Event.RELEASED): (_L, Reason.STALE),
    (_E, Event.NEUTRAL): (_E, Reason.ESTOP),
    (_E, Event.MOTION): (_E, Reason.ESTOP),
    (_E, Event.RESUMED): (_E, Reason.ESTOP),
    (_E, Event.EXPIRED): (_E, Reason.ESTOP),
    (_E, Event.BROKEN): (_E, Reason.ESTOP),
    (_E, Event.IGNORED): (_E, Reason.ESTOP),
    (_E, Event.HALTED): (_E, Reason.ESTOP),
    (_E, Event.LOST): (_E, Reason.ESTOP),
    (_E, Event.FOUND): (_E, Reason.ESTOP),
    (_E, Event.PRESSED): (_E, Reason.ESTOP),
    (_E, Event.RELEASED): (_S, Reason.NEUTRAL_FIRST),
}
