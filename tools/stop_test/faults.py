"""The table of faults: how each is made, how it is mended, and what has to stop the robot."""

import signal
from dataclasses import dataclass

from hal.codec import encode
from hal.messages import Bool
from tools.stop_test import acts
from tools.stop_test.acts import HOUR_S, Act, driver_word, link, mend_link, nothing, put, robot_word
from tools.stop_test.stands import BY_WORD, CLOCKS, DRIVERS, FUSION, KEYED, LEARNER, LINK, Stand
from tools.stop_test.verdict import BASE, DRIVER, ESTOP, FAREWELL, FIELD, GUARD, REFUSAL, WATCHDOG

STOP_BUDGET_S = 0.35


@dataclass(frozen=True, slots=True)
class Fault:
    """One row: what breaks, for `hold_s`, on which stand, and what may stop the robot.

    `below`: who is left to do it where the governor is not.
    `silence`: the fault alone is to change nothing, so the commander is stopped dead a moment after it, and that is
    measured. `asks`: once mended the commander would rightly ask for more, so it leaves before. `hand`: the commander
    is a person's hand, with a policy that drives on beneath it. `counted`: it has to show up among what was refused.
    `fatal`: the commander is of no use afterwards. `quick`: part of the short matrix.
    """

    name: str
    make: Act
    mend: Act = nothing
    hold_s: float = 0.8
    stopped_by: tuple[str, ...] = (WATCHDOG,)
    below: str = GUARD
    stand: Stand = BY_WORD
    silence: bool = False
    asks: bool = False
    hand: bool = False
    counted: bool = False
    fatal: bool = False
    quick: bool = False


KILL, FREEZE = acts.driver_signal(signal.SIGKILL), acts.driver_signal(signal.SIGSTOP)
THAW = acts.driver_signal(signal.SIGCONT)
SEES = (DRIVER, FIELD)  # whoever looks at the sensor first: the driver, or the protective field
DRIVE, WELL = driver_word("drive"), robot_word("")
RANDOM = bytes(range(7, 255, 3))

FAULTS = (
    Fault("hand's bridge killed (kill -9)", KILL, hand=True, quick=True),
    Fault("hand's bridge frozen (SIGSTOP)", FREEZE, THAW, hand=True),
    Fault("link cut for 1 s", acts.cut_link, mend_link, hold_s=1.0),
    Fault("black-out of 0.3 s", link(dark=True), mend_link, hold_s=0.3),
    Fault("black-out of 1 s", link(dark=True), mend_link, hold_s=1.0, quick=True),
    Fault("black-out of 3 s", link(dark=True), mend_link, hold_s=3.0),
    Fault("link delayed by 500 ms", link(delay_s=0.5), mend_link, hold_s=1.5),
    Fault("link throttled to 1 kB/s", link(narrow_byte_s=1e3), mend_link, hold_s=1.5),
    Fault("every third datagram lost", link(lost=1 / 3), mend_link, silence=True),
    Fault("datagrams twice", link(copies=2), mend_link, silence=True),
    Fault("datagrams swapped", link(swap=True), mend_link, silence=True),
    Fault("commands of nan", driver_word("nan"), DRIVE, stopped_by=(REFUSAL,), counted=True, quick=True),
    Fault("commands of inf", driver_word("inf"), DRIVE, stopped_by=(REFUSAL,), counted=True),
    Fault("commands of 1e308", driver_word("1e308"), silence=True),
    Fault("another type on cmd_vel", put(encode(Bool(True))), silence=True, counted=True),
    Fault("random bytes on cmd_vel", put(RANDOM), silence=True, counted=True, quick=True),
    Fault("stamps an hour ahead", driver_word("an hour ahead"), DRIVE, hold_s=1.2, counted=True),
    Fault("stamps an hour behind", driver_word("an hour behind"), DRIVE, hold_s=1.2, counted=True),
    Fault("second commander", lambda bench: bench.intruder.rival(), silence=True, counted=True, quick=True),
    Fault("commander with an old epoch", acts.lose_the_lease, THAW, counted=True, fatal=True),
    Fault("commands replayed after 1 s", lambda bench: bench.intruder.replay(), silence=True, counted=True),
    Fault("emergency stop", acts.press, acts.release, stopped_by=(ESTOP,), quick=True),
    Fault("camera freezes", robot_word("camera freezes"), WELL, stopped_by=SEES, asks=True),
    Fault("lidar freezes", robot_word("lidar freezes"), WELL, stopped_by=SEES, asks=True, quick=True),
    Fault("half a scan", robot_word("half a scan"), WELL, stopped_by=SEES, asks=True),
    Fault("black image", robot_word("black image"), WELL, stopped_by=SEES, asks=True),
    Fault("camera read never returns", robot_word("camera hangs"), WELL, stopped_by=SEES, asks=True, quick=True),
    Fault("robot's main thread hangs", robot_word("main hangs"), silence=True, hold_s=2.0),
    Fault("lira fusion killed (kill -9)", KILL, stand=FUSION, quick=True),
    Fault("lira fusion frozen (SIGSTOP)", FREEZE, THAW, hold_s=1.6, stand=FUSION, quick=True),
    Fault("disk full under labels and record", acts.fill_disk, acts.see_it_told, hold_s=3.0,
          stopped_by=(DRIVER, FAREWELL),
          stand=LEARNER),
    Fault("link's process killed (kill -9)", acts.link_signal(signal.SIGKILL), acts.restart_link, hold_s=1.0,
          stand=LINK),
    Fault("link's process frozen (SIGSTOP)", acts.link_signal(signal.SIGSTOP), acts.link_signal(signal.SIGCONT),
          hold_s=1.0, stand=LINK),
    Fault("robot's process frozen (SIGSTOP)", acts.robot_signal(signal.SIGSTOP), acts.robot_signal(signal.SIGCONT),
          hold_s=1.6, stopped_by=(GUARD,), stand=DRIVERS),
    Fault("robot's process killed (kill -9)", acts.robot_signal(signal.SIGKILL), acts.restart_robot,
          stopped_by=(GUARD,), stand=DRIVERS),
    Fault("robot's governor hangs", robot_word("governor hangs"), WELL, stopped_by=(BASE,), below=BASE, stand=DRIVERS),
    Fault("base's driver hangs", robot_word("base hangs"), WELL, stopped_by=(GUARD,), stand=DRIVERS),
    Fault("robot's clock an hour ahead", acts.clock("robot", HOUR_S), acts.true_clock("robot"), silence=True,
          stand=CLOCKS),
    Fault("robot's clock an hour behind", acts.clock("robot", -HOUR_S), acts.true_clock("robot"), silence=True,
          stand=CLOCKS),
    Fault("driver's clock an hour ahead", acts.clock("driver", HOUR_S), acts.true_clock("driver"), silence=True,
          stand=CLOCKS),
    Fault("driver's clock an hour behind", acts.clock("driver", -HOUR_S), acts.true_clock("driver"), silence=True,
          stand=CLOCKS),
    Fault("put without a certificate", lambda bench: bench.intruder.put_plainly(), silence=True, counted=True,
          stand=KEYED),
    Fault("put with a viewer's certificate", lambda bench: bench.intruder.put_as("guest"), silence=True, counted=True,
          stand=KEYED),
)  # fmt: skip
