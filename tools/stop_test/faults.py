"""The table of faults: how each is made, how it is mended, and what has to stop the robot."""

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hal.bus import Bus
from hal.codec import encode
from hal.estop import press_estop, release_estop
from hal.messages import Bool
from tools.processes import ChildProcess
from tools.relay import LinkFaults, Relay
from tools.stop_test.intruder import Intruder

STOP_BUDGET_S = 0.35
FIRMWARE_BUDGET_S = 1.2  # the CORE2's watchdog strikes after 1.0 s, and its ramp takes a moment
LEASE_GONE_S = 1.2


class Bench(Protocol):
    """What a fault may touch."""

    relay: Relay
    observer: Bus
    intruder: Intruder

    @property
    def driver(self) -> ChildProcess:
        """The commander under test."""

    @property
    def robot(self) -> ChildProcess:
        """The robot's process."""

    def tell_driver(self, word: str) -> None:
        """Say a word to the commander under test."""

    def tell_robot(self, word: str) -> None:
        """Say a word to the robot's devices."""


Act = Callable[[Bench], None]


def _nothing(bench: Bench) -> None:
    pass


@dataclass(frozen=True, slots=True)
class Fault:
    """One row: what breaks, for `hold_s`, and what stops the robot.

    `silence`: the fault alone is to change nothing, so the commander is stopped dead a moment after it, and that is
    measured. `asks`: once mended the commander would rightly ask for more, so it leaves before. `hand`: the commander
    is a person's hand, with a policy that drives on beneath it. `frozen`: the robot's process cannot write its journal
    meanwhile, so the time is worked out from how far it went. `fatal`: the commander is of no use afterwards.
    """

    name: str
    make: Act
    mend: Act = _nothing
    hold_s: float = 0.8
    stopped_by: str = "watchdog"
    budget_s: float = STOP_BUDGET_S
    silence: bool = False
    asks: bool = False
    hand: bool = False
    frozen: bool = False
    fatal: bool = False
    quick: bool = False


def _signal(number: signal.Signals) -> Act:
    return lambda bench: bench.driver.signal(number)


def _link(**faults: float | bool) -> Act:
    def change(bench: Bench) -> None:
        for name, value in faults.items():
            setattr(bench.relay.faults, name, value)

    return change


def _mend_link(bench: Bench) -> None:
    _link(**{name: getattr(LinkFaults(), name) for name in LinkFaults.__dataclass_fields__})(bench)


def _cut(bench: Bench) -> None:
    bench.relay.faults.dark = True
    bench.relay.cut()


def _driver(word: str) -> Act:
    return lambda bench: bench.tell_driver(word)


def _robot(word: str) -> Act:
    return lambda bench: bench.tell_robot(word)


def _robot_signal(number: signal.Signals) -> Act:
    return lambda bench: bench.robot.signal(number)


def _put(payload: bytes) -> Act:
    return lambda bench: bench.intruder.put_raw(payload)


def _lose_the_lease(bench: Bench) -> None:
    bench.driver.signal(signal.SIGSTOP)
    time.sleep(LEASE_GONE_S)
    bench.intruder.take_lease()


KILL, FREEZE, THAW = _signal(signal.SIGKILL), _signal(signal.SIGSTOP), _signal(signal.SIGCONT)
SEES = "the driver stands"
RANDOM = bytes(range(7, 255, 3))

FAULTS = (
    Fault("driver killed (kill -9)", KILL, quick=True),
    Fault("driver frozen (SIGSTOP)", FREEZE, THAW, quick=True),
    Fault("hand's bridge killed", KILL, hand=True, quick=True),
    Fault("hand's bridge frozen", FREEZE, THAW, hand=True),
    Fault("link cut for 1 s", _cut, _mend_link, hold_s=1.0),
    Fault("black-out of 0.3 s", _link(dark=True), _mend_link, hold_s=0.3),
    Fault("black-out of 1 s", _link(dark=True), _mend_link, hold_s=1.0, quick=True),
    Fault("black-out of 3 s", _link(dark=True), _mend_link, hold_s=3.0),
    Fault("link delayed by 500 ms", _link(delay_s=0.5), _mend_link, hold_s=1.5),
    Fault("datagrams twice", _link(copies=2), _mend_link, silence=True),
    Fault("datagrams swapped", _link(swap=True), _mend_link, silence=True),
    Fault("commands of nan", _driver("nan"), _driver("drive"), stopped_by="refusal", quick=True),
    Fault("commands of inf", _driver("inf"), _driver("drive"), stopped_by="refusal"),
    Fault("commands of 1e308", _driver("1e308"), silence=True),
    Fault("another type on cmd_vel", _put(encode(Bool(True))), silence=True),
    Fault("random bytes on cmd_vel", _put(RANDOM), silence=True, quick=True),
    Fault("stamps an hour ahead", _driver("an hour ahead"), _driver("drive"), hold_s=1.2),
    Fault("stamps an hour behind", _driver("an hour behind"), _driver("drive"), hold_s=1.2),
    Fault("second commander", lambda bench: bench.intruder.rival(), silence=True, quick=True),
    Fault("commander with an old epoch", _lose_the_lease, THAW, fatal=True),
    Fault("commands replayed after 1 s", lambda bench: bench.intruder.replay(), silence=True),
    Fault("emergency stop", lambda bench: _ignore(press_estop(bench.observer)), lambda bench: _ignore(
        release_estop(bench.observer)), stopped_by="e-stop", quick=True),
    Fault("camera freezes", _robot("camera freezes"), _robot(""), stopped_by=SEES, asks=True),
    Fault("lidar freezes", _robot("lidar freezes"), _robot(""), stopped_by=SEES, asks=True, quick=True),
    Fault("half a scan", _robot("half a scan"), _robot(""), stopped_by=SEES, asks=True),
    Fault("camera read never returns", _robot("camera hangs"), _robot(""), stopped_by=SEES, asks=True, quick=True),
    Fault("black image", _robot("black image"), _robot(""), stopped_by=SEES, asks=True),
    Fault("robot's main thread hangs", _robot("main hangs"), silence=True, hold_s=2.0),
    Fault("base hangs on a command", _robot("base hangs"), _robot(""), hold_s=1.6, stopped_by="firmware",
          budget_s=FIRMWARE_BUDGET_S),
    Fault("robot's process frozen", _robot_signal(signal.SIGSTOP), _robot_signal(signal.SIGCONT), hold_s=1.6,
          stopped_by="firmware", budget_s=FIRMWARE_BUDGET_S, frozen=True),
)  # fmt: skip


def _ignore(answer: object) -> None:
    """An acknowledgement came; the journal says the rest."""
