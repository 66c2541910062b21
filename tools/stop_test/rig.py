"""The processes under test on one stand: a robot, its commanders, the link between them, and somebody to watch."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec

from hal.bus import Bus
from hal.keys import VARIABLE as KEYS_VARIABLE
from hal.keys import load_keys
from hal.messages import Episode, Source
from hal.profile import RobotProfile, load_profile
from hal.topics import APPLIED, DIAGNOSTICS, INFO, RESET
from tools import relay
from tools.processes import ChildProcess, free_port, lira_command
from tools.stop_test import driver, hand, robot, shifted, world
from tools.stop_test.acts import StopTestError
from tools.stop_test.control import TIME, say
from tools.stop_test.intruder import Intruder
from tools.stop_test.journal import read_journal
from tools.stop_test.stands import Stand, clock_library

READY_S = 60.0
AGAIN_S = 5.0
MOVING_S = 20.0  # a link that was dark comes back within seconds
SETTLE_S = 0.3
FAST = 0.95  # share of its top speed at which a driver by word has got going; a policy looks where it goes
CAREFUL = 0.3
CLOCK_S = 6.0
NEAR_S = 60.0
ANSWER_S = 5.0
POLL_S = 0.02
POLICY, HAND, ROBOT, WORLD = "policy", "hand", "robot", "world"
READY = {POLICY: driver.READY, HAND: hand.READY, ROBOT: robot.READY, WORLD: world.READY}


class Rig:
    """Implements `acts.Bench`."""

    def __init__(self, stack: ExitStack, folder: Path, profile: str, stand: Stand) -> None:
        self._stack, self._folder, self._stand = stack, folder, stand
        self._profile_name = stand.profile or profile
        self.profile: RobotProfile = load_profile(self._profile_name)
        self.name, self._port, self._front = f"stop_{free_port()}", free_port(), free_port()
        self.journal = folder / "journal.bin"
        self._keys = folder / "keys" if stand.keys else None
        self._ears = {role: free_port() for role in READY}
        self._running: dict[str, ChildProcess] = {}
        self._tested, self._runs = POLICY, 0
        if self._keys is not None:
            from hal.keys import Role
            from tools.authority import enroll, init

            init(self._keys)
            enroll(self._keys, "guest", Role.VIEWER)
        if stand.drivers:
            words = [self._profile_name, str(self.journal), str(self._ears[WORLD]), str(folder)]
            self._run_module(WORLD, world.__name__, words)
        self.restart_robot()
        behind = self._port
        if stand.link:
            behind = free_port()
            self._link_words = [str(behind), str(self._port)]
            self.restart_link()
        self.relay = stack.enter_context(relay.Relay(self._front, behind))
        keys = None if self._keys is None else load_keys(self._keys / "laptop")
        self.observer = Bus(self.name, connect=f"127.0.0.1:{self._port}", keys=keys)
        stack.callback(self.observer.close)
        self.observer.ask(INFO)
        self._applied, self._reports = self.observer.reader(APPLIED), self.observer.reader(DIAGNOSTICS)
        self.intruder = Intruder(self.observer, self._keys)

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
        return self._running["link"]

    @property
    def run_folder(self) -> Path:
        """Where a commander that learns writes."""
        return self._folder / f"run-{self._runs}"

    def tell_driver(self, word: str) -> None:
        """Say a word to the commander under test."""
        say(self._ears[self._tested], word)

    def tell_robot(self, word: str) -> None:
        """Say a word to the robot's devices."""
        say(self._ears[ROBOT], word)

    def restart_robot(self) -> None:
        """Start the robot's process."""
        words = [self.name, f"127.0.0.1:{self._port}", self._profile_name, str(self.journal), str(self._ears[ROBOT])]
        if self._stand.drivers:
            words += [str(self._folder), self._running[WORLD].output().partition(world.READY)[2].split()[0]]
        self._run_module(ROBOT, robot.__name__, words)

    def restart_link(self) -> None:
        """Start the process in the link."""
        self._run("link", [sys.executable, "-P", "-m", relay.__name__, *self._link_words], relay.READY)

    def set_clock(self, who: str, offset_s: int) -> None:
        """Set a process's time of day. Raises `StopTestError` if it takes no notice."""
        role = self._write_clock(who, offset_s)
        deadline_s = time.monotonic() + CLOCK_S
        while True:
            say(self._ears[role], "what time")
            time.sleep(POLL_S * 5)
            told = self._running[role].output().rpartition(TIME)[2].split()
            if told and abs(float(told[0]) - time.time() - offset_s) < NEAR_S:
                return
            if time.monotonic() > deadline_s:
                raise StopTestError(f"the {who}'s clock cannot be set", "Is libfaketime whole?")

    def reset_clock(self, who: str) -> None:
        """Set a process's time of day to the true one, within a second of its running."""
        self._write_clock(who, 0)

    def _write_clock(self, who: str, offset_s: int) -> str:
        role = ROBOT if who == "robot" else self._tested
        self._clock_file(role).write_text(f"{offset_s:+d}", encoding="utf-8")
        return role

    def drive(self, *, by_hand: bool) -> None:
        """Put the robot back to its start and get it going. Raises `StopTestError` if it does not."""
        self._tested = HAND if by_hand else POLICY
        if self._stand.drivers:
            say(self._ears[WORLD], "reset")
            time.sleep(SETTLE_S)
        else:
            self.observer.ask(RESET, msgspec.json.encode(Episode()))
        for role in (POLICY, HAND) if by_hand else (POLICY,):
            self._start_commander(role)
            self._wait_until_it_drives(role)
        time.sleep(SETTLE_S)

    def _start_commander(self, role: str) -> None:
        words = [self.name, f"127.0.0.1:{self._front}"]
        if self._stand.fusion:
            self._runs += 1
            fusion = [word.format(run=self.run_folder) for word in self._stand.fusion]
            self._run(role, lira_command("fusion", *fusion, "--name", words[0], "--connect", words[1]), self.name)
            return
        if role not in self._running or self._running[role].status() is not None:
            module = hand.__name__ if role == HAND else driver.__name__
            self._run_module(role, module, [*words, str(self._ears[role])])
        say(self._ears[role], "go")

    def _wait_until_it_drives(self, role: str) -> None:
        began_s = told_s = time.monotonic()
        while not (self.is_fast(began_s) and self._source() is (Source.TELEOP if role == HAND else Source.POLICY)):
            if not self._stand.fusion and time.monotonic() - told_s > AGAIN_S:
                # A busy machine stopped the robot before it was fast, and it waits for a stick at rest.
                say(self._ears[role], "leave")
                time.sleep(SETTLE_S)
                say(self._ears[role], "go")
                told_s = time.monotonic()
            if time.monotonic() - began_s > MOVING_S:
                raise StopTestError(
                    f"the robot did not get going; {role} wrote:\n{self._running[role].tail()}", "Look there."
                )
            time.sleep(POLL_S)

    def is_fast(self, since_s: float = 0.0) -> bool:
        """Whether the robot drives as it does when nothing is wrong, and has been told so since a time."""
        given, _ = read_journal(self.journal, since_s)
        share = CAREFUL if self._stand.fusion else FAST
        return bool(given) and given[-1].linear_m_s > share * self.profile.base.max_linear_m_s

    def _source(self) -> Source:
        newest = self._applied.newest()
        return Source.NONE if newest is None else newest.message.source

    def refused(self) -> int:
        """How much the robot has refused so far, by its next report. Raises `StopTestError` if none comes."""
        self._reports.poll()
        deadline_s = time.monotonic() + ANSWER_S
        while not (reports := self._reports.poll()):
            if time.monotonic() > deadline_s:
                raise StopTestError("the robot says nothing on diagnostics", "Look whether it still runs.")
            time.sleep(POLL_S)
        values = [pair for status in reports[-1].message.status for pair in status.values]
        return sum(int(value) for name, value in values if name.startswith("refused"))

    def renew(self, *, fatal: bool) -> None:
        """After a trial: everybody leaves; a commander that is of no use ends."""
        for role in (POLICY, HAND):
            if role in self._running:
                say(self._ears[role], "leave")
                self._running[role].signal(signal.SIGCONT)
        if fatal:
            self.intruder.leave()
        if fatal or self._stand.fusion:
            self._running.pop(self._tested).stop()
        time.sleep(SETTLE_S)

    def _run_module(self, role: str, module: str, words: list[str]) -> None:
        python = [sys.executable, "-P", "-m", *([shifted.__name__] if self._stand.clocks else [])]
        self._run(role, [*self._environment(role), *python, module, *words], READY[role])

    def _run(self, role: str, command: list[str], ready: str) -> None:
        process = self._stack.enter_context(ChildProcess(role, command, self._folder / f"{role}.log"))
        self._running[role] = process
        process.wait_ready(ready, READY_S)

    def _environment(self, role: str) -> list[str]:
        """Words that start a command with what is peculiar to the stand."""
        settings = {}
        if self._keys is not None:
            settings[KEYS_VARIABLE] = str(self._keys / ("robot" if role == ROBOT else "laptop"))
        if self._stand.clocks:
            self._clock_file(role).write_text("+0", encoding="utf-8")
            settings["LD_PRELOAD"] = str(clock_library())
            settings["FAKETIME_TIMESTAMP_FILE"] = str(self._clock_file(role))
            settings["FAKETIME_CACHE_DURATION"] = "1"
            settings["FAKETIME_DONT_FAKE_MONOTONIC"] = "1"
        return ["env", *(f"{name}={value}" for name, value in settings.items())] if settings else []

    def _clock_file(self, role: str) -> Path:
        return self._folder / f"{role}.clock"


@contextmanager
def rig(folder: Path, profile: str, stand: Stand) -> Iterator[Rig]:
    """Start everything on a stand, and stop it in the end."""
    with ExitStack() as stack:
        folder.mkdir(parents=True, exist_ok=True)
        yield Rig(stack, folder, profile, stand)
