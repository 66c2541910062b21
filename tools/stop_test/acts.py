"""How faults are made and mended: each act does something to the bench on which a robot drives."""

import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import press_estop, release_estop
from lira.tools.launch.link_fault import LinkFaults, Relay
from lira.tools.launch.processes import ChildProcess
from lira.tools.stop_test.errors import StopTestError
from lira.tools.stop_test.parts.intruder import Intruder

LEASE_GONE_S = 1.2
HOUR_S = 3600
CREEP_S, CREEPS = 0.02, 30
STEP_S = 0.05
RECORD_S, REPLAY_S = 1.0, 0.02
RECORDED, LAST = 10, 5  # some twenty commands are under way in a second
BURST_S = 0.1
ENDED_S = 8.0


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

    @property
    def link(self) -> ChildProcess:
        """The process in the link."""

    @property
    def run_folder(self) -> Path:
        """Where a commander that learns writes."""

    def restart_robot(self) -> None:
        """Start the robot's process again."""

    def restart_link(self) -> None:
        """Start the process in the link again."""

    def tell_driver(self, message: str) -> None:
        """Send a control message to the commander under test."""

    def tell_robot(self, message: str) -> None:
        """Send one to the robot's process."""

    def tell_world(self, message: str) -> None:
        """Send one to the robot's devices."""

    def wait_expired(self) -> None:
        """Wait until the commander's certificate runs out."""

    def revoke(self, name: str) -> None:
        """Shut a name out, as `lira keys revoke` does."""

    def set_clock(self, who: str, offset_s: int) -> None:
        """Set the time of day of "robot" or "driver" so much ahead of the true one."""

    def reset_clock(self, who: str) -> None:
        """Set it right."""


Act = Callable[[Bench], None]


def nothing(bench: Bench) -> None:
    """Mend by waiting."""


def driver_signal(number: signal.Signals) -> Act:
    """Send the commander a signal."""
    return lambda bench: bench.driver.signal(number)


def robot_signal(number: signal.Signals) -> Act:
    """Send the robot's process a signal."""
    return lambda bench: bench.robot.signal(number)


def driver_does(message: str) -> Act:
    """Send the commander a control message."""
    return lambda bench: bench.tell_driver(message)


def robot_does(message: str) -> Act:
    """Send the robot's process a control message."""
    return lambda bench: bench.tell_robot(message)


def world_does(message: str) -> Act:
    """Send the robot's devices a control message."""
    return lambda bench: bench.tell_world(message)


def one_by_one(*acts: Act) -> Act:
    """Do one after the other."""

    def do(bench: Bench) -> None:
        for act in acts:
            act(bench)

    return do


def pause(for_s: float) -> Act:
    """Let time pass."""
    return lambda bench: time.sleep(for_s)  # noqa: ARG005 - an act has a bench


def flood(kind: str) -> Act:
    """Send as much of a kind as fits through, from now on."""
    return lambda bench: bench.intruder.flood(kind)


def rest(bench: Bench) -> None:
    """End what the intruder goes on with."""
    bench.intruder.rest()


def put(payload: bytes) -> Act:
    """Put bytes on `cmd_vel`, again and again."""
    return lambda bench: bench.intruder.put_raw(payload)


def link(**faults: float | bool) -> Act:
    """Make the link bad."""

    def change(bench: Bench) -> None:
        for name, value in faults.items():
            setattr(bench.relay.faults, name, value)

    return change


def creep(bench: Bench) -> None:
    """Delay the link a little more, again and again: nothing stops coming, all of it comes later and later."""
    for count in range(1, CREEPS + 1):
        bench.relay.faults.delay_s = count * CREEP_S
        time.sleep(STEP_S)


def mend_link(bench: Bench) -> None:
    """Make the link good."""
    link(**{name: getattr(LinkFaults(), name) for name in LinkFaults.__dataclass_fields__})(bench)


def cut_link(bench: Bench) -> None:
    """Break what is connected, and let nothing through."""
    bench.relay.faults.dark = True
    bench.relay.cut()


def link_signal(number: signal.Signals) -> Act:
    """Send the process in the link a signal."""
    return lambda bench: bench.link.signal(number)


def restart_link(bench: Bench) -> None:
    """Start it again."""
    bench.restart_link()


def restart_robot(bench: Bench) -> None:
    """Start the robot's process again."""
    bench.restart_robot()


def rival(bench: Bench) -> None:
    """Let somebody else command."""
    bench.intruder.rival()


def forge(ahead_s: float) -> Act:
    """Let somebody command with a copy of all that the robot tells of its commander, stamped so much ahead of now."""
    return lambda bench: bench.intruder.forge(ahead_s)


def idle_joystick(bench: Bench) -> None:
    """Plug in a ROS joystick that nobody touches."""
    bench.intruder.idle_joystick()


def put_plainly(bench: Bench) -> None:
    """Let somebody command who has no certificate."""
    bench.intruder.put_plainly()


def put_as(name: str) -> Act:
    """Let somebody command who has another's certificate."""
    return lambda bench: bench.intruder.put_as(name)


def release_as(name: str) -> Act:
    """Let somebody release the emergency stop who has another's certificate."""
    return lambda bench: bench.intruder.release_as(name)


def put_in_name(who: str, name: str) -> Act:
    """Let somebody command in another's name who has a certificate to drive in an own one."""
    return lambda bench: bench.intruder.put_in_name(who, name)


def replay_commands(bench: Bench) -> None:
    """Freeze the commander, and say again what it said, byte for byte, in another session.

    Commands are passed on to nobody, and keys hide them: this takes somebody in the link of a robot without any.
    Raises `StopTestError` if too little was recorded.
    """
    recorded = bench.relay.record(RECORD_S)
    bench.driver.signal(signal.SIGSTOP)
    _require(bench.intruder.repeat([one.data for one in recorded]), "commands")


def replay_datagrams(bench: Bench) -> None:
    """Freeze the commander, and send again the datagrams of its link. Raises `StopTestError` if there were too few."""
    recorded = bench.relay.record(RECORD_S)
    bench.driver.signal(signal.SIGSTOP)
    for one in [*recorded[-LAST:], *recorded, *recorded[-LAST:]]:
        bench.relay.replay(one)
        time.sleep(REPLAY_S)
    _require(len(recorded), "datagrams")


def _require(count: int, what: str) -> None:
    if count < RECORDED:
        raise StopTestError(f"only {count} {what} of the commander were recorded", "Does UDP get through?")


def wait_expired(bench: Bench) -> None:
    """Wait until the commander's certificate runs out."""
    bench.wait_expired()


def revoke(name: str) -> Act:
    """Shut a name out."""
    return lambda bench: bench.revoke(name)


def end_robot(bench: Bench) -> None:
    """Tell the robot's process to end, as a terminal and a service manager do at once, and wait until it has."""
    until_s = time.monotonic() + BURST_S
    while time.monotonic() < until_s:
        bench.robot.signal(signal.SIGINT)
        bench.robot.signal(signal.SIGTERM)
    if bench.robot.wait(ENDED_S) is None:
        raise StopTestError("the robot's process does not end", f"It wrote:\n{bench.robot.tail()}")


def lose_the_lease(bench: Bench) -> None:
    """Freeze the commander until its lease is over, and give that to somebody else."""
    bench.driver.signal(signal.SIGSTOP)
    time.sleep(LEASE_GONE_S)
    bench.intruder.take_lease()


def fill_disk(bench: Bench) -> None:
    """Let no file of the commander grow any more, as on a full disk: neither labels nor record."""
    biggest = max(path.stat().st_size for path in bench.run_folder.iterdir())
    resource.prlimit(bench.driver.pid, resource.RLIMIT_FSIZE, (biggest, biggest))


def see_it_told(bench: Bench) -> None:
    """Look whether the commander said that it could not write. Raises `StopTestError` if not."""
    if "cannot write" not in bench.driver.output():
        raise StopTestError("the learner kept quiet about a full disk", f"It wrote:\n{bench.driver.tail()}")


def clock(who: str, offset_s: int) -> Act:
    """Set a process's time of day."""
    return lambda bench: bench.set_clock(who, offset_s)


def true_clock(who: str) -> Act:
    """Set it right."""
    return lambda bench: bench.reset_clock(who)


def press(bench: Bench) -> None:
    """Press the emergency stop."""
    press_estop(bench.observer)


def release(bench: Bench) -> None:
    """Release it."""
    release_estop(bench.observer)
