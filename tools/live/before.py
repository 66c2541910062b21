"""What other days left in a session's record: its counts go on. Pure but for reading the file."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from lira.fusion.log.counts import NOTHING, Account, Ledger
from lira.fusion.log.run_log import LapRecord, Record, ResultRecord, RunRecord, StepRecord, read_run
from lira.hal.errors import ConfigError
from lira.hal.messages import Decision, Driver, Phase


@dataclass(frozen=True, slots=True)
class Before:
    """The `newest` decision, None if there was none; laps of teaching by their number, cut off ones too; the share of
    each of them that was driven alone; and the `layouts` that were driven. A day that was killed has no `account`.
    """

    newest: Decision | None = None
    account: Account = NOTHING
    laps: int = 0
    passed: int = 0
    collisions: int = 0
    lost: int = 0
    curve: tuple[float, ...] = ()
    layouts: frozenset[int] = field(default_factory=frozenset)

    def go_on(self, ledger: Ledger) -> None:
        """Have a ledger count on from here."""
        if (newest := self.newest) is not None:
            ledger.go_on(newest.labels, newest.interventions, newest.calls, self.account)


def sum_up(records: Iterable[Record], head: RunRecord | None = None) -> Before:
    """Sum up a record. Raises `ConfigError` if it is of another method or robot than `head` says."""
    newest: Decision | None = None
    account, laps, layouts = NOTHING, list[LapRecord](), set[int]()
    steps, human = Counter[int](), Counter[int]()
    for record in records:
        match record:
            case StepRecord(decision=decision, layout=layout):
                newest = decision
                layouts.add(layout)
                if decision.phase == Phase.TRAIN:
                    steps[decision.lap] += 1
                    human[decision.lap] += decision.driver == Driver.HUMAN
            case LapRecord():
                laps += [record] * (record.phase == Phase.TRAIN)
            case ResultRecord():
                account = record.account
            case RunRecord():
                if head is not None and (record.preset, record.profile) != (head.preset, head.profile):
                    then, now = (f"by '{each.preset}' on a '{each.profile}'" for each in (record, head))
                    what = f"this folder was taught {then}, not {now}"
                    raise ConfigError(what, "Go on with these, or choose another --run.")
    return Before(
        newest,
        account,
        laps=max(steps, default=0),
        passed=sum(lap.passed for lap in laps),
        collisions=sum(lap.collisions for lap in laps),
        lost=sum(lap.lost for lap in laps),
        curve=tuple(1.0 - human[lap.lap] / max(1, steps[lap.lap]) for lap in laps),
        layouts=frozenset(layouts),
    )


def days_before(path: Path, head: RunRecord | None = None) -> Before:
    """The same of a file, which may not be there yet."""
    return sum_up(read_run(path) if path.is_file() else (), head)
