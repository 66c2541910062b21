"""The processes under test in one setup: a robot, its commanders, the link between them, and somebody to watch."""

import contextlib
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import load_keys
from lira.hal.bus.services import release_estop
from lira.hal.bus.topics import APPLIED, DIAGNOSTICS, INFO, RESET
from lira.hal.errors import BusError
from lira.hal.messages import Episode, Source
from lira.hal.profile import RobotProfile, load_profile
from lira.tools.launch import link_fault as relay
from lira.tools.launch.processes import ChildProcess, ProcessError, free_port
from lira.tools.stop_test.commands import HAND, POLICY, ROBOT, WORLD, Commands
from lira.tools.stop_test.control import ASK_TIME, TIME, tell
from lira.tools.stop_test.errors import StopTestError
from lira.tools.stop_test.journal import Journal, JournalReader
from lira.tools.stop_test.mutants import Mutant
from lira.tools.stop_test.parts import driver, hand, pulse, robot, ros2_world, world
from lira.tools.stop_test.parts.intruder import Intruder
from lira.tools.stop_test.setups import BRIEF, LAPTOP, Setup
from lira.tools.stop_test.starved import waits_s

if TYPE_CHECKING:
    from lira.tools.stop_test.keyring import Keyring

READY_S = 60.0
AGAIN_S = 5.0
MOVING_S = 25.0  # a link that was dark comes back within seconds
SETTLE_S = 0.3
FAST = 0.95  # share of its top speed at which a driver by word has got going; a policy looks where it goes
CAREFUL = 0.3
CLOCK_S = 6.0
NEAR_S = 60.0
ANSWER_S = 5.0
RELEASE_S = 1.0
POLL_S = 0.02
LINK, PULSE = "link", "pulse"
TOLD = (POLICY, HAND, ROBOT, WORLD)  # who takes control messages
NOTED = {HAND: "hand"}  # a driver notes by itself what it sends


class ProcessBench:
    """Implements `acts.Bench`. With a `mutant` the process that it belongs to is broken by it."""

    def __init__(self, stack: ExitStack, folder: Path, profile: str, setup: Setup, mutant: Mutant | None) -> None:
        self._stack, self._folder, self._setup = stack, folder, setup
        self._profile_name = setup.profile or profile
        self.profile: RobotProfile = load_profile(self._profile_name)
        self.name, self._port, self._front = f"stop_{free_port()}", free_port(), free_port()
        self._journal = JournalReader(folder / "journal")
        self._ports = {role: free_port() for role in TOLD}
        self._running: dict[str, ChildProcess] = {}
        self._tested, self._runs, self._certificate = POLICY, 0, LAPTOP
        self._keyring = _make_keys(folder / "keys") if setup.keys else None
        self._commands = Commands(folder, self._journal.folder, setup, self._keyring, mutant)
        command = [sys.executable, "-m", pulse.__name__, str(self._journal.folder)]
        self._run(PULSE, command, pulse.READY)
        self._bridge = free_port()
        if setup.world:
            words = [self._profile_name, str(self._journal.folder), str(self._ports[WORLD])]
            words.append(str(self._bridge if setup.ros2 else folder))
            self._run_module(WORLD, ros2_world if setup.ros2 else world, words)
        self.restart_robot()
        behind = self._port
        if setup.link:
            behind = free_port()
            self._link_words = [str(behind), str(self._port)]
            self.restart_link()
        self.relay = stack.enter_context(relay.Relay(self._front, behind))
        keys = None if self._keyring is None else load_keys(self._keyring.prepare(LAPTOP))
        self.observer = Bus(self.name, connect=f"127.0.0.1:{self._port}", keys=keys)
        stack.callback(self.observer.close)
        self.observer.ask(INFO)
        self._applied, self._reports = self.observer.reader(APPLIED), self.observer.reader(DIAGNOSTICS)
        self.intruder = Intruder(self.observer, self._journal.folder, self._keyring)
        stack.callback(self.intruder.close)

    @property
    def driver(self) -> ChildProcess:
        """The commander under test."""
        return self._running[self._tested]

    @property
    def robot(self) -> ChildProcess:
        """The robot's process."""
        return self._running[ROBOT]

    @property
    def link(self) -> ChildProcess:
        """The process in the link."""
        return self._running[LINK]

    @property
    def run_folder(self) -> Path:
        """Where a commander that learns writes."""
        return self._folder / f"run-{self._runs}"

    def tell_driver(self, message: str) -> None:
        """Send a control message to the commander under test."""
        tell(self._ports[self._tested], message)

    def tell_robot(self, message: str) -> None:
        """Send one to the robot's process."""
        tell(self._ports[ROBOT], message)

    def tell_world(self, message: str) -> None:
        """Send one to the robot's devices."""
        tell(self._ports[WORLD], message)

    def restart_robot(self) -> None:
        """Start the robot's process."""
        words = [self.name, f"127.0.0.1:{self._port}", self._profile_name]
        words += [str(self._journal.folder), str(self._ports[ROBOT])]
        if self._setup.drivers:
            words += [str(self._folder), self._running[WORLD].output().partition(world.READY)[2].split()[0]]
        elif self._setup.ros2:
            words.append(str(self._bridge))
        self._run_module(ROBOT, robot, words)

    def restart_link(self) -> None:
        """Start the process in the link."""
        self._run(LINK, [sys.executable, "-m", relay.__name__, *self._link_words], relay.READY)

    def set_clock(self, who: str, offset_s: int) -> None:
        """Set a process's time of day. Raises `StopTestError` if it takes no notice."""
        role = self._write_clock(who, offset_s)
        deadline_s = time.monotonic() + CLOCK_S
        while True:
            tell(self._ports[role], ASK_TIME)
            time.sleep(POLL_S * 5)
            told = self._running[role].output().rpartition(TIME)[2].split()
            if told and abs(float(told[0]) - time.time() - offset_s) < NEAR_S:
                return
            if time.monotonic() > deadline_s:
                raise StopTestError(f"the {who}'s clock cannot be set", "Is libfaketime whole?")

    def reset_clock(self, who: str) -> None:
        """Set a process's time of day to the true one, within a second of its running."""
        self._write_clock(who, 0)

    def wait_expired(self) -> None:
        """Wait until the commander's certificate runs out."""
        assert self._keyring is not None
        self._keyring.wait_expired()

    def revoke(self, name: str) -> None:
        """Shut a name out."""
        assert self._keyring is not None
        self._keyring.revoke(name)

    def drive(self, *, by_hand: bool, certificate: str) -> None:
        """Put the robot back to its start and get it going. Raises `StopTestError` if it does not."""
        self._tested = HAND if by_hand else POLICY
        self._journal.skip()
        if self._setup.world:
            tell(self._ports[WORLD], "reset")
            time.sleep(SETTLE_S)
        else:
            self.observer.ask(RESET, msgspec.json.encode(Episode()))
        self._show(certificate)
        for role in (POLICY, HAND) if by_hand else (POLICY,):
            self._start_commander(role)
            self._wait_until_it_drives(role)
        time.sleep(SETTLE_S)

    def is_fast(self, since_s: float = 0.0) -> bool:
        """Whether the robot drives as it does when nothing is wrong, and has been told so since a time."""
        wheels = [one for one in self.noted().wheels if one.time_s >= since_s]
        share = CAREFUL if self._setup.fusion else FAST
        return bool(wheels) and wheels[-1].linear_m_s > share * self.profile.base.max_linear_m_s

    def ask_for_motion(self) -> None:
        """Have the commander, or another if it is dead, ask for motion, and never for zero.

        A robot that lets nobody come back is asked by nobody, and that is what fails its row.
        """
        if self._running[POLICY].status() is not None:
            with contextlib.suppress(ProcessError):
                self._run_driver()
        self._running[self._tested].signal(signal.SIGCONT)
        tell(self._ports[POLICY], "insist")

    def waits_s(self) -> dict[str, float]:
        """How long each thread of each process has waited for a processor."""
        return waits_s(process.pid for process in self._running.values())

    def noted(self) -> Journal:
        """What was noted since the robot was put back to its start."""
        return self._journal.read()

    def refused(self, reasons: tuple[str, ...]) -> int:
        """How much was refused so far for one of these reasons, by the robot's next report. Raises `StopTestError`."""
        self._reports.poll()
        deadline_s = time.monotonic() + ANSWER_S
        while not (reports := self._reports.poll()):
            if time.monotonic() > deadline_s:
                raise StopTestError("the robot says nothing on diagnostics", "Check that it is still running.")
            time.sleep(POLL_S)
        values = [pair for status in reports[-1].message.status for pair in status.values]
        return sum(int(count) for name, count in values if _refusal(name) in reasons)

    def renew(self, *, fatal: bool) -> None:
        """After a trial: everybody leaves; a commander that is of no use ends."""
        self.intruder.rest()
        for role in (POLICY, HAND):
            if role in self._running:
                tell(self._ports[role], "leave")
                self._running[role].signal(signal.SIGCONT)
        with contextlib.suppress(BusError):
            release_estop(self.observer, RELEASE_S)
        if fatal:
            with contextlib.suppress(TimeoutError):
                self.intruder.leave()
        if fatal or self._setup.fusion:
            self._running.pop(POLICY).stop()
        time.sleep(SETTLE_S)

    def _show(self, certificate: str) -> None:
        """Have the commander show this certificate, and a new one if it is brief."""
        if (certificate != self._certificate or certificate == BRIEF) and POLICY in self._running:
            self._running.pop(POLICY).stop()
        self._certificate = certificate

    def _write_clock(self, who: str, offset_s: int) -> str:
        role = ROBOT if who == "robot" else self._tested
        self._commands.clock_file(role).write_text(f"{offset_s:+d}", encoding="utf-8")
        return role

    def _start_commander(self, role: str) -> None:
        if self._setup.fusion:
            self._runs += 1
            fusion = [word.format(run=self.run_folder) for word in self._setup.fusion]
            words = [*fusion, "--name", self.name, "--connect", f"127.0.0.1:{self._front}"]
            self._run(POLICY, self._commands.start(POLICY, "lira.tools", words, self._certificate, "fusion"), self.name)
            return
        if role not in self._running or self._running[role].status() is not None:
            if role == POLICY:
                self._run_driver()
            else:
                words = [self.name, f"127.0.0.1:{self._front}", str(self._ports[HAND])]
                self._run_module(HAND, hand, words)
        tell(self._ports[role], "go")

    def _run_driver(self) -> None:
        words = [self.name, f"127.0.0.1:{self._front}", str(self._ports[POLICY]), str(self._journal.folder)]
        self._run_module(POLICY, driver, words)

    def _wait_until_it_drives(self, role: str) -> None:
        began_s = told_s = time.monotonic()
        while not (self.is_fast(began_s) and self._source() is (Source.TELEOP if role == HAND else Source.POLICY)):
            if not self._setup.fusion and time.monotonic() - told_s > AGAIN_S:
                # A busy machine stopped the robot before it was fast, and it waits for a stick at rest.
                tell(self._ports[role], "leave")
                time.sleep(SETTLE_S)
                tell(self._ports[role], "go")
                told_s = time.monotonic()
            if time.monotonic() - began_s > MOVING_S:
                raise StopTestError(
                    f"the robot did not get going; {role} wrote:\n{self._running[role].tail()}", "Look there."
                )
            time.sleep(POLL_S)

    def _source(self) -> Source:
        newest = self._applied.newest()
        return Source.NONE if newest is None else newest.message.source

    def _run_module(self, role: str, module: ModuleType, words: list[str]) -> None:
        self._run(
            role, self._commands.start(role, module.__name__, words, self._certificate, NOTED.get(role)), module.READY
        )

    def _run(self, role: str, command: list[str], ready: str) -> None:
        process = self._stack.enter_context(ChildProcess(role, command, self._folder / f"{role}.log"))
        self._running[role] = process
        process.wait_ready(ready, READY_S)


def _make_keys(folder: Path) -> "Keyring":
    from lira.tools.stop_test.keyring import Keyring

    return Keyring(folder)


def _refusal(name: str) -> str:
    """Why something was refused, by the name of its count; "" for what is no such count."""
    head, *rest = name.replace("refused ", "refused: ").split(": ")
    return rest[-1] if head == "refused" and rest else ""


@contextmanager
def open_bench(folder: Path, profile: str, setup: Setup, mutant: Mutant | None = None) -> Iterator[ProcessBench]:
    """Start everything of a setup, and stop it in the end."""
    with ExitStack() as stack:
        folder.mkdir(parents=True, exist_ok=True)
        yield ProcessBench(stack, folder, profile, setup, mutant)
