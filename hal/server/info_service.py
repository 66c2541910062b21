"""The HAL server's front desk: who am I talking to, and, for a twin, start afresh."""

from collections.abc import Callable
from typing import Annotated, Literal

import msgspec

from lira.hal.bus.bus import Bus, Question
from lira.hal.bus.topics import INFO, RESET
from lira.hal.errors import BusError, CodecError, LiraError
from lira.hal.messages import Episode
from lira.hal.messages.bounds import LARGEST
from lira.hal.messages.codec import decode_json
from lira.hal.port import Arena
from lira.hal.profile import RobotProfile

REALTIME: Literal["realtime"] = "realtime"
LOCKSTEP: Literal["lockstep"] = "lockstep"
RESETS = 1  # at a time

Token = Annotated[int, msgspec.Meta(ge=0)]  # msgspec keeps integers within 64 bits
Moment = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)]


class Info(msgspec.Struct, frozen=True):
    """What a robot says about itself. `arena` is whatever its twin says about its world, null for a real floor."""

    profile: RobotProfile
    mode: Literal["realtime", "lockstep"]
    epoch: Token
    arena: msgspec.Raw = msgspec.Raw(b"null")

    def to_json(self) -> bytes:
        """Encode for the bus."""
        return msgspec.json.encode(self)


def info_from_json(data: bytes) -> Info:
    """Decode what `Info.to_json` wrote. Raises `BusError`."""
    try:
        info: Info = decode_json(Info, data)
    except CodecError as error:
        raise BusError(f"the robot says what is not understood: {error}", "Run one version on both sides.") from error
    return info


def reset_time(answer: bytes) -> float:
    """Return when a reset happened, from the robot's answer to it. Raises `BusError`."""
    try:
        moment_s: float = decode_json(Moment, answer)
    except CodecError as error:
        raise BusError(f"the robot says what is not understood: {error}", "Run one version on both sides.") from error
    return moment_s


class Desk:
    """Answers `info` and, with an arena, `sim/reset`. To be polled by the thread that owns the robot.

    The answer to a reset is the robot's time of it, as JSON: what was captured earlier is of the last episode.
    """

    def __init__(self, bus: Bus, info: Info, arena: Arena | None, now: Callable[[], float]) -> None:
        self._info = info.to_json()
        self._arena = arena
        self._now = now
        self._info_asked = bus.questions(INFO)
        self._reset_asked = None if arena is None else bus.questions(RESET)

    def serve(self, show: Callable[[], None]) -> None:
        """Answer what was asked since the last time, and call `show` before the answers.

        `show` publishes the robot's newest observation, so that whoever asks has it when the answer comes. Many who
        ask cost the robot one, and one new start at a time.
        """

        def answer_reset(question: Question) -> None:
            reset_s = self._now()
            if why := self._reset(question.payload):
                question.refuse(why)
            else:
                show()
                question.answer(msgspec.json.encode(reset_s))

        self._info_asked.serve(lambda question: question.answer(self._info), prepare=show)
        if self._reset_asked is not None:
            self._reset_asked.serve(answer_reset, most=RESETS)

    def _reset(self, payload: bytes) -> str | None:
        """Start the episode; returns why not."""
        assert self._arena is not None
        try:
            self._arena.reset(decode_json(Episode, payload))
        except CodecError as error:
            return f"not an episode: {error}"
        except LiraError as error:
            return str(error)
        return None
