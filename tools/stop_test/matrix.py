"""The matrix: one fault after the other on a robot that drives, and what became of it."""

import random
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import msgspec

from hal.bus import Bus
from hal.errors import LiraError
from hal.estop import look_at_estop
from hal.messages import Episode
from hal.profile import RobotProfile, load_profile
from hal.topics import INFO, RESET
from tools.processes import ChildProcess, free_port
from tools.relay import Relay
from tools.stop_test import driver, robot
from tools.stop_test.control import say
from tools.stop_test.faults import Bench, Fault
from tools.stop_test.intruder import Intruder
from tools.stop_test.journal import read_journal
from tools.stop_test.verdict import Row, Verdict, judge, summarize

READY_S = 40.0
MOVING_S = 12.0  # a link that was dark comes back within seconds
SETTLE_S = 0.3
WATCH_S = 0.7  # after the fault is mended: it must not move again by itself
BEFORE_SILENCE_S = 0.3
POLL_S = 0.02
POLICY, HAND = "policy", "teleop"


class StopTestError(LiraError):
    """The robot under test did not do what has to come before a fault."""


class Rig:
    """The processes under test; implements `faults.Bench`."""

    def __init__(self, stack: ExitStack, folder: Path, profile: str) -> None:
        self._stack, self._folder = stack, folder
        self.profile: RobotProfile = load_profile(profile)
        self.name, port, self._front = f"stop_{free_port()}", free_port(), free_port()
        self.journal = folder / "journal.bin"
        self._ears = {role: free_port() for role in (POLICY, HAND, "robot")}
        self._drivers: dict[str, ChildProcess] = {}
        self._tested = POLICY
        endpoint = f"127.0.0.1:{port}"
        words = [self.name, endpoint, profile, str(self.journal), str(self._ears["robot"])]
        self.robot = self._start("robot", "tools.stop_test.robot", words, robot.READY)
        self.relay = stack.enter_context(Relay(self._front, port))
        self.observer = Bus(self.name, connect=endpoint)
        stack.callback(self.observer.close)
        self.observer.ask(INFO)
        self.intruder = Intruder(self.observer)

    def _start(self, name: str, module: str, words: list[str], ready: str) -> ChildProcess:
        command = [sys.executable, "-P", "-m", module, *words]
        process = self._stack.enter_context(ChildProcess(name, command, self._folder / f"{name}.log"))
        process.wait_ready(ready, READY_S)
        return process

    @property
    def driver(self) -> ChildProcess:
        """The commander under test."""
        return self._drivers[self._tested]

    def tell_driver(self, word: str) -> None:
        """Say a word to the commander under test."""
        say(self._ears[self._tested], word)

    def tell_robot(self, word: str) -> None:
        """Say a word to the robot's devices."""
        say(self._ears["robot"], word)

    def drive(self, *, hand: bool) -> None:
        """Put the robot back to its start and get it going. Raises `StopTestError` if it does not."""
        self._tested = HAND if hand else POLICY
        self.observer.ask(RESET, msgspec.json.encode(Episode()))
        began_s = time.monotonic()
        for role in (POLICY, HAND) if hand else (POLICY,):
            if role not in self._drivers or self._drivers[role].status() is not None:
                words = [self.name, f"127.0.0.1:{self._front}", role, str(self._ears[role])]
                self._drivers[role] = self._start(role, "tools.stop_test.driver", words, driver.READY)
            say(self._ears[role], "go")
        while not self._fast_since(began_s):
            if time.monotonic() - began_s > MOVING_S:
                raise StopTestError("the robot did not get going", f"Look into {self._folder}.")
            time.sleep(POLL_S)
        time.sleep(SETTLE_S)

    def _fast_since(self, began_s: float) -> bool:
        given, _ = read_journal(self.journal, began_s)
        return bool(given) and given[-1].linear_m_s > 0.95 * self.profile.base.max_linear_m_s

    def refused(self) -> int:
        """How many commands the robot has refused so far."""
        return sum(look_at_estop(self.observer).refused.values())

    def renew(self, fault: Fault) -> None:
        """After a trial: everybody leaves; who lost the lease ends."""
        for role, process in self._drivers.items():
            say(self._ears[role], "leave")
            process.signal(signal.SIGCONT)
        if fault.fatal:
            self.intruder.leave()
            self._drivers.pop(self._tested).stop()
        time.sleep(SETTLE_S)


@contextmanager
def rig(folder: Path, profile: str) -> Iterator[Rig]:
    """Start everything, and stop it in the end."""
    with ExitStack() as stack:
        yield Rig(stack, folder, profile)


def run_matrix(
    bench: Rig, faults: tuple[Fault, ...], trials: int, seed: int, say_row: Callable[[Row], None]
) -> list[Row]:
    """Try every fault `trials` times."""
    chance = random.Random(seed)
    rows = []
    for fault in faults:
        verdicts = [try_fault(bench, fault, chance.uniform(0.0, bench.profile.period_s)) for _ in range(trials)]
        rows.append(summarize(fault.name, fault.stopped_by, verdicts, fault.budget_s))
        say_row(rows[-1])
    return rows


def try_fault(bench: Rig, fault: Fault, phase_s: float) -> Verdict:
    """One trial: drive, break, wait, mend, watch."""
    bench.drive(hand=fault.hand)
    refused_before = bench.refused()
    time.sleep(phase_s)
    began_s = time.monotonic() - SETTLE_S
    broken_s = _break(bench, fault)
    time.sleep(fault.hold_s)
    healed_s = time.monotonic()
    if fault.asks:
        bench.tell_driver("leave")
        time.sleep(SETTLE_S)
    fault.mend(bench)
    time.sleep(WATCH_S)
    given, truth = read_journal(bench.journal, began_s)
    verdict = judge(given, truth, broken_s, healed_s + WATCH_S, bench.profile, frozen=fault.frozen)
    verdict = replace(verdict, refused=bench.refused() - refused_before)
    bench.renew(fault)
    return verdict


def _break(bench: Bench, fault: Fault) -> float:
    """Make the fault; returns from when on the robot has to stop."""
    broken_s = time.monotonic()
    fault.make(bench)
    if fault.silence:
        time.sleep(BEFORE_SILENCE_S)
        broken_s = time.monotonic()
        bench.driver.signal(signal.SIGSTOP)
    return broken_s
