"""Holds the blocks of a study and keeps what comes of them: a folder a person, a row a block, the export, the page.

Whoever takes part sees letters in the place of methods: on the terminal, in the report of a block, in folders. What
tells the methods apart (the table, the export, the page on all of it) is for who holds the study.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from lira.hal.config import write_whole
from lira.hal.errors import ConfigError
from lira.tools.report import write_report
from lira.tools.report.digest import load_run
from lira.tools.runs.names import RECORD
from lira.tools.study import script
from lira.tools.study.analysis import render
from lira.tools.study.order import blinded, order
from lira.tools.study.plan import StudyPlan
from lira.tools.study.questions import Answered, Ask, ask_all
from lira.tools.study.table import ANALYSIS, EXPORT, TABLE, export, read_rows, row_of, write_rows

CONSENT = "consent.txt"
DRY = 3  # participants of a dry run
Say = Callable[[str], None]


class Study:
    """A plan, and the `folder` in which everything is kept."""

    def __init__(self, plan: StudyPlan, folder: Path, say: Say) -> None:
        self._plan, self._folder, self._say = plan, folder, say

    def dry_run(self) -> None:
        """Everything with scripts in the place of people. Raises `ConfigError` if the folder already holds a study."""
        if (self._folder / TABLE).exists():
            raise ConfigError(f"{self._folder} already holds a study", "Choose another folder with --to.")
        for participant in range(1, DRY + 1):
            for place, method in enumerate(order(self._plan.methods, participant), start=1):
                script.teach_block(self._plan, method, participant, self.block(participant, place))
                self._keep(participant, place, script.answer(participant, place, self._plan.questions))
                words = f"participant {participant} ({script.skill_of(participant)}), block {place}"
                self._say(f"{words}: method {self.letter(participant, method)}")

    def hold_next(self, participant: int, teach: Callable[[list[str]], int], ask: Ask) -> int:
        """Hold the first block that a participant has not done: `teach` takes the words of `lira teach`.

        Returns its exit status, 1 without consent. Raises `ConfigError` if there is no such participant or block.
        """
        plan = self._plan
        if not 1 <= participant <= plan.participants:
            raise ConfigError(f"there is no participant {participant}", f"The plan has 1 to {plan.participants}.")
        methods, place = order(plan.methods, participant), self._done(participant) + 1
        if place > len(methods):
            raise ConfigError(f"participant {participant} has done every block", "See --analyse.")
        if not self._agrees(participant, ask):
            return 1
        self._say(f"block {place} of {len(methods)}: method {self.letter(participant, methods[place - 1])}")
        status = teach(self._words(participant, place))
        if status in (0, 1):  # the novice passed, or did not: either is a result
            self._keep(participant, place, ask_all(plan.questions, ask))
            return 0
        return status

    def conclude(self) -> None:
        """Write the export and the page. Raises `ConfigError` if there is no block yet."""
        rows = read_rows(self._folder / TABLE)
        if not rows:
            raise ConfigError(f"{self._folder} holds no block yet", "Begin with --participant 1, or try --dry-run.")
        export(self._folder / EXPORT, rows)
        write_whole(self._folder / ANALYSIS, render(self._plan.title, rows).encode())
        names = [self._folder / name for name in (TABLE, EXPORT, ANALYSIS)]
        self._say("table: {}, without names: {}, analysis: {}".format(*names))

    def block(self, participant: int, place: int) -> Path:
        """Where a block is kept."""
        return self._folder / name_of(participant) / f"block-{place}"

    def letter(self, participant: int, method: str) -> str:
        """What a method is called on this participant's screen."""
        return blinded(self._plan.methods, participant, self._plan.seed)[method]

    def _done(self, participant: int) -> int:
        return sum(row.participant == name_of(participant) for row in read_rows(self._folder / TABLE))

    def _agrees(self, participant: int, ask: Ask) -> bool:
        """Ask for consent before the first block, and keep what was agreed to."""
        kept = self._folder / name_of(participant) / CONSENT
        if kept.is_file():
            return True
        text = f"{self._plan.title}\n\n{self._plan.consent.strip()}\n"
        self._say(text)
        if ask("Do you agree to take part? yes or no").strip().lower() not in ("y", "yes"):
            return False
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_whole(kept, f"{text}\nagreed: {datetime.now(UTC):%Y-%m-%d %H:%M} UTC\n".encode())
        return True

    def _words(self, participant: int, place: int) -> list[str]:
        plan = self._plan
        method = order(plan.methods, participant)[place - 1]
        words = ["--as", name_of(participant), "--method", method, "--shown-as", self.letter(participant, method)]
        words += ["--world", plan.world, "--layout", str(plan.layout), "--run", str(self.block(participant, place))]
        words += ["--practice", str(plan.practice_s), "--unseen", str(plan.unseen), "--minutes", str(plan.minutes)]
        words += ["--speed", str(plan.speed), "--seed", str(plan.seed + participant)]
        return words if plan.until_passed else [*words, "--whole-time"]

    def _keep(self, participant: int, place: int, answered: Answered) -> None:
        """Write the block's report, and its row."""
        method, block = order(self._plan.methods, participant)[place - 1], self.block(participant, place)
        letter = self.letter(participant, method)
        write_report(block, shown_as=letter)
        row = row_of(load_run(block / RECORD), name_of(participant), place, method, letter, answered)
        write_rows(self._folder / TABLE, [*read_rows(self._folder / TABLE), row])


def name_of(participant: int) -> str:
    """What a participant is called: nobody's name is written down."""
    return f"participant-{participant:03d}"
