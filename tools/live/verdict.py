"""What a session's proof comes to, in words that say how sure so few laps make it."""

from collections.abc import Sequence

from lira.fusion.log.run_log import LapRecord
from lira.hal.messages import Phase
from lira.tools.output.proven import share_words

SPARE = 12  # of so many unseen layouts one may fail


def has_passed(laps: Sequence[LapRecord]) -> bool:
    """Whether the novice can: where it was taught, and on all unseen layouts but one in `SPARE`."""
    own = [lap for lap in laps if lap.phase == Phase.PROVE]
    unseen = [lap for lap in laps if lap.phase == Phase.UNSEEN]
    failed = sum(not lap.passed for lap in unseen)
    return bool(own) and all(lap.passed for lap in own) and failed <= len(unseen) // SPARE


def verdict_words(laps: Sequence[LapRecord]) -> str:
    """What was proven on a twin, like: drove 11 of 12 unseen layouts; 95 %: 62 to 100 %."""
    own = [lap for lap in laps if lap.phase == Phase.PROVE]
    unseen = [lap for lap in laps if lap.phase == Phase.UNSEEN]
    if not own or not all(lap.passed for lap in own):
        return "It did not drive the course it was taught on alone" + _because(own)
    if not unseen:
        return "It drove the course it was taught on alone; unseen layouts were not tried"
    words = f"It drove {share_words(sum(lap.passed for lap in unseen), len(unseen))}"
    return words + _because(unseen)


def judged_words(passed: int, drives: int) -> str:
    """What a person has judged on a real floor."""
    return f"It drove {share_words(passed, drives, 'time', ' as you wanted')}"


def _because(laps: Sequence[LapRecord]) -> str:
    failed = [lap for lap in laps if not lap.passed]
    if not failed:
        return ""
    collisions, lost = sum(lap.collisions for lap in failed), sum(lap.lost for lap in failed)
    helped = sum(not lap.unassisted for lap in failed)
    parts = [f"collisions: {collisions}" if collisions else "", f"lost: {lost}" if lost else ""]
    parts.append(f"you took over: {helped}" if helped else "")
    found = ", ".join(filter(None, parts)) or "it stood, or did not arrive in time"
    return f" ({found})"
