"""What a session makes of a person's request, by the stage that it is at. Pure."""

from dataclasses import dataclass

from lira.fusion.operator_service import Answer
from lira.hal.messages import Request, Stage

TAUGHT = frozenset({Stage.DEMONSTRATION, Stage.TEACHING})
_GO_ON = frozenset({Request.RESUME, Request.PAUSE})  # the same button
_WELL = frozenset({Request.PROVE, Request.PASSED})
_BADLY = frozenset({Request.RESET, Request.FAILED})


@dataclass(frozen=True, slots=True)
class Reply:
    """`ends` is what the present lap or stage ends with, None if it goes on."""

    answer: Answer
    ends: Request | None = None


def reply(request: Request, stage: Stage, *, trained: bool) -> Reply | None:
    """What becomes of a request; None for one that is no matter of the session. One button serves several stages."""
    if request is Request.FINISH or (request is Request.PROVE and stage is Stage.VERDICT):
        return Reply((True, "the session ends"), Request.FINISH)
    if request in _GO_ON and stage in (Stage.PRACTICE, Stage.VERDICT):
        over = "practice is over" if stage is Stage.PRACTICE else "teaching goes on"
        return Reply((True, over), Request.RESUME)
    if stage is Stage.JUDGING and request in _WELL | _BADLY:
        passed = request in _WELL
        return Reply((True, f"noted: {'passed' if passed else 'failed'}"), Request.PASSED if passed else Request.FAILED)
    if request in (Request.PASSED, Request.FAILED):
        return Reply((False, "there is nothing to judge now"))
    if request is Request.PROVE:
        if stage not in TAUGHT:
            return Reply((False, "nothing is taught now"))
        if not trained:
            return Reply((False, "it has learned nothing yet"))
        return Reply((True, "the novice alone, to prove what it can: hands off"), Request.PROVE)
    if request is Request.UNDO and stage not in TAUGHT | {Stage.VERDICT}:
        return Reply((False, "not now: while it is taught, or at the verdict"))
    if request is Request.RESET and stage in TAUGHT | {Stage.PROVING, Stage.EXAM}:
        return Reply((True, "a new lap"), Request.RESET)
    return None
