"""The matrix: one fault after the other on a robot that drives, and what became of it."""

import random
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from tools.stop_test.acts import StopTestError
from tools.stop_test.faults import STOP_BUDGET_S, Fault
from tools.stop_test.journal import read_journal
from tools.stop_test.rig import SETTLE_S, Rig, rig
from tools.stop_test.stands import clock_library
from tools.stop_test.verdict import Row, Verdict, judge, summarize

ATTEMPTS = 5
WATCH_S = 0.7  # after the fault is mended: it must not move again by itself
BEFORE_SILENCE_S = 0.3


def run_matrix(
    faults: Sequence[Fault], folder: Path, profile: str, trials: int, seed: int, say_row: Callable[[Row], None]
) -> list[Row]:
    """Try every fault `trials` times, those of one stand together; logs and journals go into `folder`."""
    chance = random.Random(seed)
    rows = []
    for number, (stand, group) in enumerate(groupby(faults, key=lambda fault: fault.stand)):
        with rig(folder / str(number), profile, stand) as bench:
            for fault in group:
                phases_s = [chance.uniform(0.0, bench.profile.period_s) for _ in range(trials)]
                verdicts = [try_fault(bench, fault, phase_s) for phase_s in phases_s]
                rows.append(summarize(fault.name, fault.stopped_by, verdicts, STOP_BUDGET_S, counted=fault.counted))
                say_row(rows[-1])
    return rows


def missing(fault: Fault) -> str:
    """What this machine lacks to try a fault; "" if nothing."""
    if fault.stand.clocks and clock_library() is None:
        return "libfaketime (Debian package libfaketime)"
    return ""


def try_fault(bench: Rig, fault: Fault, phase_s: float) -> Verdict:
    """One trial: drive, break, wait, mend, watch."""
    refused_before = _get_going(bench, fault, phase_s)
    began_s = time.monotonic() - SETTLE_S
    broken_s = time.monotonic()
    fault.make(bench)
    if fault.silence:
        time.sleep(BEFORE_SILENCE_S)
        bench.driver.signal(signal.SIGSTOP)
    time.sleep(fault.hold_s)
    healed_s = time.monotonic()
    if fault.asks:
        bench.tell_driver("leave")
        time.sleep(SETTLE_S)
    fault.mend(bench)
    time.sleep(WATCH_S)
    given, truth = read_journal(bench.journal, began_s)
    verdict = judge(given, truth, broken_s, healed_s + WATCH_S, bench.profile, fault.below)
    if fault.counted:
        verdict = replace(verdict, refused=bench.refused() - refused_before)
    bench.renew(fatal=fault.fatal)
    return verdict


def _get_going(bench: Rig, fault: Fault, phase_s: float) -> int:
    """Drive, and return what was refused so far. A busy machine may stop the robot before the fault does: once more."""
    for _ in range(ATTEMPTS):
        bench.drive(by_hand=fault.hand)
        refused = bench.refused() if fault.counted else 0
        time.sleep(phase_s)
        if bench.is_fast():
            return refused
        bench.renew(fatal=False)
    raise StopTestError("the robot does not keep going", "The machine is too busy: end some programs.")
