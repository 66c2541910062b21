"""Motion: who asks for it, and what the wheels get. Units and stamps as in `values.py`."""

import hashlib
from dataclasses import dataclass
from enum import StrEnum

Token = tuple[str, int]  # who commands: a name, and a session


@dataclass(frozen=True, slots=True)
class Twist:
    """Planar velocity of base_link (geometry_msgs/Twist: linear.x, angular.z)."""

    linear_m_s: float
    angular_rad_s: float


STOP = Twist(0.0, 0.0)
NEUTRAL_LIMIT = 1e-6  # below this, in m/s and rad/s, a command is neutral


def is_neutral(twist: Twist) -> bool:
    """Whether a command asks for no motion at all."""
    return abs(twist.linear_m_s) < NEUTRAL_LIMIT and abs(twist.angular_rad_s) < NEUTRAL_LIMIT


@dataclass(frozen=True, slots=True)
class TwistStamped:
    """geometry_msgs/TwistStamped: what newer ROS 2 controllers want instead; `stamp_s` is when it was decided."""

    stamp_s: float
    twist: Twist


class Source(StrEnum):
    """Who a command comes from, or who drives."""

    NONE = "none"
    POLICY = "policy"
    TELEOP = "teleop"


class Reason(StrEnum):
    """Why the wheels get what they get."""

    OK = "ok"
    NO_COMMAND = "no_command"  # nothing has been commanded yet
    STALE = "stale"  # the newest command is older than its time-out, or a device is lost: `clamps` names it
    NEUTRAL_FIRST = "neutral_first"  # stopped or just started: a neutral command has to come first
    REFUSED = "refused"  # the newest command was refused (non-finite, out of order)
    OBSTACLE = "obstacle"  # something is in the way, or the lidar does not say
    ESTOP = "estop"  # the emergency stop is pressed


# A robot that stopped by itself is armed by the next zero: that has to be somebody's decision.
HELD = frozenset({Reason.STALE, Reason.NEUTRAL_FIRST, Reason.REFUSED, Reason.ESTOP})


@dataclass(frozen=True, slots=True)
class Command:
    """A wish to move, in SI units.

    `stamp_s` is when it was decided, `answers` the sequence number of the observation it answers (-1: none).
    `released` marks the last command of a commander: the teleop command that follows the release of the dead-man (the
    control goes back to the policy), or a policy's farewell. `commander` is the name on the certificate of whoever
    commands, "" without keys; `epoch` is their session, which they keep to themselves, and `seq` its count.
    """

    twist: Twist
    stamp_s: float
    source: Source = Source.POLICY
    answers: int = -1
    released: bool = False
    epoch: int = 0
    seq: int = -1
    commander: str = ""

    @property
    def token(self) -> Token:
        """Who commands: the name, and the session, which nobody else knows."""
        return self.commander, self.epoch


@dataclass(frozen=True, slots=True)
class Applied:
    """What the base really got, from whom, and why (`cmd_vel/applied`).

    `commander`, `session` and `seq` name the command it came from, `command_age_s` says how old that was. `session` is
    a digest of the commander's epoch (`session_of`): it knows its own by that, and nobody learns the epoch.
    `field_cut_m_s` is the forward speed that the protective field took from what was commanded, with its sign.
    """

    twist: Twist
    stamp_s: float
    source: Source = Source.NONE
    reason: Reason = Reason.NO_COMMAND
    clamps: tuple[str, ...] = ()
    answers: int = -1
    command_age_s: float = float("nan")
    session: int = 0
    seq: int = -1
    commander: str = ""
    field_cut_m_s: float = 0.0

    @property
    def unhindered(self) -> Twist:
        """What the base would have got without the protective field."""
        return Twist(self.twist.linear_m_s + self.field_cut_m_s, self.twist.angular_rad_s)


def session_of(epoch: int) -> int:
    """What may be told of an epoch (64 bits) to everybody: who has it knows it again, and nobody gets it from there."""
    return int.from_bytes(hashlib.blake2b(epoch.to_bytes(8, "little"), digest_size=8).digest(), "little")
