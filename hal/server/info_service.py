"""The HAL server's front desk: who am I talking to, and, for a twin, start afresh."""

from collections.abc import Callable

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.questions import Question
from lira.hal.bus.services import Info
from lira.hal.bus.topics import INFO, RESET
from lira.hal.errors import CodecError, LiraError
from lira.hal.messages import Episode
from lira.hal.messages.ros.codec import decode_json
from lira.hal.port import Arena

RESETS = 1  # at a time


class InfoService:
    """Answers `info` and, with an arena, `sim/reset`. To be polled by the thread that owns the robot.

    The answer to a reset is its time as the bus has it, as JSON: what was captured earlier is of the last episode.
    """

    def __init__(self, bus: Bus, info: Info, arena: Arena | None, now: Callable[[], float]) -> None:
        self._info = info.to_json()
        self._arena = arena
        self._now = now
        self._bus = bus
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
                question.answer(msgspec.json.encode(reset_s + self._bus.offset_s))

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
