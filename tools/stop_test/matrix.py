"""The matrix: one row after the other on a robot that drives, and what became of it."""

import math
import random
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import count, groupby
from pathlib import Path

from lira.hal.errors import LiraError
from lira.tools.stop_test.errors import StopTestError
from lira.tools.stop_test.mutants import Mutant
from lira.tools.stop_test.rows import Row
from lira.tools.stop_test.setups import Setup, clock_library
from lira.tools.stop_test.starved import longest_s
from lira.tools.stop_test.testbed import SETTLE_S, ProcessBench, open_bench
from lira.tools.stop_test.verdict import ASKED, Bounds, Result, Rules, Verdict, judge, summarize, within

ATTEMPTS = 5
REPEATS, STALL_S = 2, 0.06
WAITED_S = 0.2  # in a trial of some seconds; beside an idle machine's processes it is a tenth of that
ASKED_S = 8.0  # until motion has been asked for often enough; a link may have to come back first
WATCH_S = 0.4  # after that: it must not move
BEFORE_SILENCE_S = 0.3
TICK_S = 0.02  # the watchdog may look this much after the time-out
LOOK_S = 0.05
TOLD_S = 0.2  # the wheels of every setup are told at least each 0.1 s


class Matrix:
    """Tries rows, those of one setup on one bench. Logs and journals go into `folder`."""

    def __init__(self, folder: Path, profile: str, seed: int, mutant: Mutant | None = None) -> None:
        self._folder, self._profile, self._mutant = folder, profile, mutant
        self._chance = random.Random(seed)
        self._numbers = count()

    def run(self, rows: Sequence[Row], trials: int | None, say: Callable[[Result], None]) -> list[Result]:
        """Try every row, as often as it says or `trials` times."""
        results: list[Result] = []
        for setup, group in groupby(rows, key=lambda row: row.setup):
            for result in self._run_setup(setup, list(group), trials):
                say(result)
                results.append(result)
        return results

    def _run_setup(self, setup: Setup, rows: list[Row], trials: int | None) -> Iterator[Result]:
        bench: ProcessBench | None = None
        with ExitStack() as stack:
            for row in rows:
                try:
                    if bench is None:
                        folder = self._folder / str(next(self._numbers))
                        bench = stack.enter_context(open_bench(folder, self._profile, setup, self._mutant))
                    yield self._run_row(bench, row, trials or row.trials)
                except (LiraError, TimeoutError) as error:
                    yield broken(row, error)
                    stack.close()  # nobody knows what state it is in
                    bench = None

    def _run_row(self, bench: ProcessBench, row: Row, trials: int) -> Result:
        phases_s = [self._chance.uniform(0.0, bench.profile.period_s) for _ in range(trials)]
        bounds = Bounds(row.budget_s, frozenset(row.stopped_by), row.within_s, bool(row.refusal))
        return summarize(row.name, bounds, [try_fairly(bench, row, bounds, phase_s) for phase_s in phases_s])


def broken(row: Row, error: Exception) -> Result:
    """What to say of a row that could not be tried."""
    nothing = Verdict(float("inf"), float("inf"), 0.0, 0, moved_unasked=False, stopped_by="nothing")
    why = str(error).splitlines()[0]
    return summarize(row.name, Bounds(row.budget_s, frozenset()), [nothing]) | {"error": f"could not be tried: {why}"}


def missing(row: Row) -> str:
    """What this machine lacks to try a row; "" if nothing."""
    if row.setup.clocks and clock_library() is None:
        return "libfaketime (Debian package libfaketime)"
    return ""


def try_fairly(bench: ProcessBench, row: Row, bounds: Bounds, phase_s: float) -> Verdict:
    """One trial; if it fails while the machine had no time for anybody, another, which may fail as well."""
    verdict = try_row(bench, row, phase_s)
    for _ in range(REPEATS):
        if within(bounds, verdict) or (verdict.stall_s < STALL_S and verdict.waited_s < WAITED_S):
            break
        verdict = try_row(bench, row, phase_s)
    return verdict


def try_row(bench: ProcessBench, row: Row, phase_s: float) -> Verdict:
    """One trial: drive, break, wait, mend, ask for motion again, judge."""
    refused_before = _get_going(bench, row, phase_s)
    waits_s, broken_s = bench.waits_s(), time.monotonic()
    row.make(bench)
    silent_s = -math.inf
    if row.silence:
        time.sleep(BEFORE_SILENCE_S)
        silent_s = time.monotonic()
        bench.driver.signal(signal.SIGSTOP)
    time.sleep(row.hold_s)
    mended_s = time.monotonic()
    row.mend(bench)
    rules = replace(_rules(bench, row, broken_s, mended_s), silent_s=silent_s)
    if not row.resumes:
        bench.ask_for_motion()
    verdict = replace(_watch(bench, rules), waited_s=longest_s(waits_s, bench.waits_s()))
    if row.refusal:
        verdict = replace(verdict, refused=bench.refused(row.refusal) - refused_before)
    bench.renew(fatal=row.fatal)
    return verdict


def _rules(bench: ProcessBench, row: Row, broken_s: float, mended_s: float) -> Rules:
    """What may happen in this trial, of which all but the asking is over."""
    control = bench.profile.control
    timeout_s = control.teleop_timeout_s if row.hand else control.policy_timeout_s
    return Rules(
        began_s=broken_s - SETTLE_S,
        broken_s=broken_s,
        mended_s=mended_s,
        end_s=mended_s,
        drives=row.drives,
        # Below the governor the wheels keep what they have until somebody tells them otherwise: the budget bounds that.
        stale_s=row.budget_s if row.setup.world else timeout_s + TICK_S,
        resumes=row.resumes,
        renews=row.renews,
        shut_out_s=float("inf") if row.shut_out_s is None else broken_s + row.shut_out_s,
        asked_from_s=time.monotonic(),
        below=row.below,
    )


def _watch(bench: ProcessBench, rules: Rules) -> Verdict:
    """Wait until motion was asked for often enough, and a moment more, and judge."""
    until_s = time.monotonic() + ASKED_S
    while _judge(bench, rules).asked < ASKED and time.monotonic() < until_s:
        time.sleep(LOOK_S)
    time.sleep(WATCH_S)
    return _judge(bench, rules)


def _judge(bench: ProcessBench, rules: Rules) -> Verdict:
    return judge(bench.noted(), replace(rules, end_s=time.monotonic()))


def _get_going(bench: ProcessBench, row: Row, phase_s: float) -> int:
    """Drive, and return what was refused so far. A busy machine may stop the robot before the fault does: once more."""
    for _ in range(ATTEMPTS):
        bench.drive(by_hand=row.hand, certificate=row.certificate)
        row.first(bench)
        refused = bench.refused(row.refusal) if row.refusal else 0
        time.sleep(phase_s)
        if bench.is_fast(time.monotonic() - TOLD_S):
            return refused
        bench.renew(fatal=False)
    raise StopTestError("the robot does not keep going", "The machine is too busy: end some programs.")
