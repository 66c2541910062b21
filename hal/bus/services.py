"""What a robot answers besides publishing, as both ends have it: who it is, when it started afresh, its emergency stop.

Who answers is in `hal.server`. To press, to release and to look are keys of their own, so that with keys each is a
permission of its own: anybody may press and look.
"""

from typing import Annotated, Any, Literal

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import ESTOP_LOOK, ESTOP_PRESS, ESTOP_RELEASE, INFO
from lira.hal.errors import BusError, CodecError
from lira.hal.messages.bounds import LARGEST
from lira.hal.messages.ros.codec import decode_json
from lira.hal.profile import RobotProfile

REALTIME: Literal["realtime"] = "realtime"
LOCKSTEP: Literal["lockstep"] = "lockstep"
ANSWER_S = 2.0
INFO_S = 5.0

Epoch = Annotated[int, msgspec.Meta(ge=0)]  # msgspec keeps integers within 64 bits
Moment = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)]


class Info(msgspec.Struct, frozen=True):
    """What a robot says about itself. `arena` is whatever its twin says about its world, null for a real floor."""

    profile: RobotProfile
    mode: Literal["realtime", "lockstep"]
    epoch: Epoch
    arena: msgspec.Raw = msgspec.Raw(b"null")

    def to_json(self) -> bytes:
        """Encode for the bus."""
        return msgspec.json.encode(self)

    @property
    def has_arena(self) -> bool:
        """Whether it is a twin's."""
        return bytes(self.arena) != b"null"


def understood(kind: Any, data: bytes) -> Any:
    """Return what a robot says, from JSON, as a value of `kind`. Raises `BusError`."""
    try:
        return decode_json(kind, data)
    except CodecError as error:
        raise BusError(f"the robot says what is not understood: {error}", "Run one version on both sides.") from error


def info_from_json(data: bytes) -> Info:
    """Decode what `Info.to_json` wrote. Raises `BusError`."""
    info: Info = understood(Info, data)
    return info


def ask_info(bus: Bus, timeout_s: float = INFO_S) -> Info:
    """Ask a robot who it is. Raises `BusError` if it does not answer."""
    return info_from_json(bus.ask(INFO, timeout_s=timeout_s))


def reset_time(answer: bytes) -> float:
    """Return when a reset happened, from the robot's answer to it. Raises `BusError`."""
    moment_s: float = understood(Moment, answer)
    return moment_s


class EstopState(msgspec.Struct, frozen=True):
    """What the robot acknowledges: the governor's state, and how many commands it has refused, by reason."""

    state: str
    refused: dict[str, int]

    @property
    def pressed(self) -> bool:
        """Whether the emergency stop holds the robot."""
        return self.state == "emergency"


def press_estop(bus: Bus, timeout_s: float = ANSWER_S, epoch: int | None = None) -> EstopState:
    """Stop the robot and wait for its acknowledgement. Raises `BusError` if none comes: then assume that it moves.

    With `epoch` only the robot of that session acknowledges: the one that the caller hears.
    """
    return _ask(bus, ESTOP_PRESS, timeout_s, epoch)


def release_estop(bus: Bus, timeout_s: float = ANSWER_S, epoch: int | None = None) -> EstopState:
    """Let the robot go, which then waits for a neutral command. Raises `BusError`, also for who may not release."""
    return _ask(bus, ESTOP_RELEASE, timeout_s, epoch)


def look_at_estop(bus: Bus, timeout_s: float = ANSWER_S) -> EstopState:
    """Ask how it stands. Raises `BusError`."""
    return _ask(bus, ESTOP_LOOK, timeout_s, None)


def _ask(bus: Bus, key: str, timeout_s: float, epoch: int | None) -> EstopState:
    state: EstopState = understood(EstopState, bus.answer(key, timeout_s=timeout_s, epoch=epoch).payload)
    return state
