"""What a lap asked of the person and what came of it: calls, reaction times, time at the controls."""

from dataclasses import dataclass
from statistics import median

from lira.fusion.log.counts import ANSWER_S
from lira.fusion.log.run_log import StepRecord
from lira.hal.messages import Call, Driver
from lira.tools.report.digest import Lap, Run

COLUMNS = ("lap", "human drove", "share", "calls to answer", "answered", "missed", "reaction, median", "longest")
LONGEST_STEP_S = 1.0  # more between two steps was a pause, or a reset


@dataclass(frozen=True, slots=True)
class Answers:
    """`reactions_s` are from the rise of a feedback call to the dead-man; `missed` calls had no answer until 2 s after
    their end. What was asked before the first training step is the demonstration, and no call.
    """

    human_s: float
    all_s: float
    reactions_s: tuple[float, ...]
    missed: int

    @property
    def calls(self) -> int:
        """Feedback calls."""
        return len(self.reactions_s) + self.missed


def answers(lap: Lap) -> Answers:
    """Find what became of each feedback call of a lap."""
    human_s = all_s = 0.0
    rose_s: float | None = None
    ended_s = 0.0
    reactions: list[float] = []
    missed = 0
    before: StepRecord | None = None
    for step in lap.steps:
        now_s, human = step.decision.stamp_s, step.decision.driver == Driver.HUMAN
        if before is not None and 0.0 <= (passed_s := now_s - before.decision.stamp_s) <= LONGEST_STEP_S:
            all_s += passed_s
            human_s += passed_s * (before.decision.driver == Driver.HUMAN)
        calls = step.decision.call == Call.FEEDBACK and step.decision.driver != Driver.NOBODY and not human
        if rose_s is not None and human:
            reactions.append(now_s - rose_s)
            rose_s = None
        elif rose_s is not None and not calls and now_s > ended_s + ANSWER_S:
            missed, rose_s = missed + 1, None
        elif calls:
            rose_s, ended_s = now_s if rose_s is None else rose_s, now_s
        before = step
    return Answers(human_s, all_s, tuple(reactions), missed + (rose_s is not None))


def answer_cells(lap: Lap) -> list[str]:
    """One row: a text for each of `COLUMNS`."""
    found = answers(lap)
    share = f"{found.human_s / found.all_s:.0%}" if found.all_s else ""
    middle = f"{median(found.reactions_s):.2f} s" if found.reactions_s else ""
    longest = f"{max(found.reactions_s):.2f} s" if found.reactions_s else ""
    counts = map(str, (found.calls, len(found.reactions_s), found.missed))
    return [lap.title, f"{found.human_s:.1f} s", share, *counts, middle, longest]


def sum_up(run: Run) -> Answers:
    """The same of all training laps together."""
    laps = [answers(lap) for lap in run.phase("train")]
    return Answers(
        sum(lap.human_s for lap in laps),
        sum(lap.all_s for lap in laps),
        tuple(reaction for lap in laps for reaction in lap.reactions_s),
        sum(lap.missed for lap in laps),
    )
