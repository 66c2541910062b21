"""The table of rows: what is broken, how it is mended, what has to stop the robot, and who may move it.

`tools/stop_test/acts.py` has the verbs, `setups.py` what a row is tried on, `verdict.py` what its words mean.
"""

import signal
from dataclasses import dataclass, field

from lira.hal.messages import Bool
from lira.hal.messages.ros.codec import encode
from lira.tools.stop_test import acts
from lira.tools.stop_test.acts import (
    HOUR_S,
    Act,
    driver_does,
    flood,
    link,
    mend_link,
    nothing,
    one_by_one,
    pause,
    put,
    robot_does,
    world_does,
)
from lira.tools.stop_test.setups import (
    BRIEF,
    CLOCKS,
    DRIVERS,
    FUSION,
    GUEST,
    KEYED,
    LAPTOP,
    LEARNER,
    LEAVER,
    LINK,
    RIVAL,
    ROS2,
    TWIN,
    Setup,
)
from lira.tools.stop_test.verdict import (
    BASE,
    BOARD,
    CONTROLLER,
    DRIVER,
    ESTOP,
    FAREWELL,
    FIELD,
    GUARD,
    REFUSAL,
    WATCHDOG,
)

BUDGET_S = 0.35
WATCHED_S = 0.7  # a device that fell silent has to be found out first
CONTROLLER_S = 0.6  # a ROS 2 robot's own time-out, 0.5 s as usual: nothing of ours runs there
DRIVERS_S = 0.45  # below the governor: the base driver waits 0.30 s, the guard 0.20 s after the last byte it heard
FIRMWARE_S = 1.2  # nobody is left but the board's own watchdog, 1.0 s after the last command it had


@dataclass(frozen=True, slots=True)
class Row:
    """One row: what breaks, for `hold_s`, on which setup, and what may stop the robot.

    `first`: done while it drives, and changes nothing. `budget_s`: from the last command that was obeyed until the
    wheels have zero; `within_s`: from the fault. `drives`: who may move the robot. `below`: who stops it where the
    governor does not. `silence`: the fault alone is to change nothing, so the commander is frozen a moment after it,
    and that is measured. `resumes`: once it is mended the commander may rightly drive on, after a neutral command (that
    comes after the mending, if it `renews`); otherwise it asks for motion and must not get any. `hand`: the commander
    is a person's hand, with a policy that drives on beneath it. `refusal`: one of these reasons has to be counted.
    `shut_out_s`: how long after the fault the commander may still be obeyed. `certificate`: what it shows. `fatal`: it
    is of no use afterwards. `trials`: how often, if not asked otherwise. `quick`: part of the short matrix.
    """

    name: str
    make: Act
    mend: Act = nothing
    hold_s: float = 0.8
    stopped_by: tuple[str, ...] = (WATCHDOG,)
    budget_s: float = BUDGET_S
    within_s: float = float("inf")
    first: Act = nothing
    drives: frozenset[str] = frozenset({"driver"})
    below: str = GUARD
    setup: Setup = TWIN
    silence: bool = False
    resumes: bool = False
    renews: bool = False
    hand: bool = False
    refusal: tuple[str, ...] = ()
    shut_out_s: float | None = None
    certificate: str = LAPTOP
    fatal: bool = False
    trials: int = 2
    quick: bool = field(default=False, kw_only=True)


KILL, FREEZE = acts.driver_signal(signal.SIGKILL), acts.driver_signal(signal.SIGSTOP)
THAW = acts.driver_signal(signal.SIGCONT)
ROBOT_FREEZE, ROBOT_THAW = acts.robot_signal(signal.SIGSTOP), acts.robot_signal(signal.SIGCONT)
SEES = (DRIVER, FIELD)  # whoever looks at the sensor first: the driver, or the protective field
DRIVE, INSIST, WELL = driver_does("drive"), driver_does("insist"), robot_does("")
RANDOM = bytes(range(7, 255, 6))  # no longer than a command
HAND, LIRA = frozenset({"hand"}), frozenset({"fusion"})
NO_DEVICE = (WATCHDOG, BASE, FIELD, "neutral first")
SENSOR_S = 0.7  # a sensor is old after 0.3 s for the driver, after 0.5 s for the field; then a tick

REPAIRED = one_by_one(world_does("well"), pause(3.0))
OBSTACLE = one_by_one(world_does("obstacle"), pause(1.0), world_does("well"))


def board_resets(boot_s: float) -> Row:
    """The board is reset in mid drive, and is up again after `boot_s`; what it is sent meanwhile it may keep."""
    return Row(
        f"board reset, up after {boot_s} s",
        one_by_one(INSIST, world_does(f"board resets {boot_s}")),
        pause(2.0),
        hold_s=boot_s,
        stopped_by=(BOARD, *NO_DEVICE),
        below=BOARD,
        setup=DRIVERS,
        trials=1,
    )


def clock_set(who: str, offset_s: int, words: str) -> Row:
    """The time of day of one process is set wrong."""
    return Row(
        f"{who}'s clock an hour {words}",
        acts.clock(who, offset_s),
        acts.true_clock(who),
        silence=True,
        setup=CLOCKS,
        trials=1,
    )


def flooded(kind: str, setup: Setup = TWIN, *, quick: bool = False) -> Row:
    """Two more peers send as much as they can, and the commander dies in it."""
    where = "" if setup is TWIN else f" on {setup.name}"
    return Row(
        f"flood of {kind}{where}",
        one_by_one(INSIST, flood(kind), pause(1.0), KILL),
        acts.rest,
        hold_s=1.5,
        stopped_by=(WATCHDOG, REFUSAL, BASE, GUARD),
        setup=setup,
        quick=quick,
    )


ROWS = (
    # Processes and links.
    Row("commander killed (kill -9)", KILL),
    Row("commander frozen (SIGSTOP)", FREEZE, THAW, quick=True),
    Row("commander's loop hangs", driver_does("hang"), hold_s=1.5, within_s=0.85, trials=1),
    Row("hand's bridge killed (kill -9)", KILL, drives=HAND, hand=True, quick=True),
    Row("hand's bridge frozen (SIGSTOP)", FREEZE, THAW, drives=HAND, hand=True),
    Row("link cut for 1 s", acts.cut_link, mend_link, hold_s=1.0),
    Row("black-out of 0.3 s", link(dark=True), mend_link, hold_s=0.3),
    Row("black-out of 1 s", link(dark=True), mend_link, hold_s=1.0, quick=True),
    Row("black-out of 3 s", link(dark=True), mend_link, hold_s=3.0, trials=1),
    Row("link delayed by 500 ms", link(delay_s=0.5), mend_link, hold_s=1.5),
    Row("link delayed more and more", one_by_one(INSIST, acts.creep), mend_link),
    Row("link throttled to 1 kB/s", link(narrow_byte_s=1e3), mend_link, hold_s=1.5),
    Row("every third datagram lost", one_by_one(INSIST, link(lost=1 / 3)), mend_link, silence=True),
    Row("datagrams twice", one_by_one(INSIST, link(copies=2)), mend_link, silence=True),
    Row("datagrams swapped", one_by_one(INSIST, link(swap=True)), mend_link, silence=True),
    # Commands that are none.
    Row("commands of nan", driver_does("nan"), stopped_by=(REFUSAL,), refusal=("not finite",), quick=True),
    Row("commands of inf", driver_does("inf"), stopped_by=(REFUSAL,), refusal=("not finite",), trials=1),
    Row("commands of 1e308", driver_does("1e308"), silence=True, trials=1),
    Row("another type on cmd_vel", put(encode(Bool(True))), silence=True, refusal=("undecodable",), trials=1),
    Row("random bytes on cmd_vel", put(RANDOM), silence=True, refusal=("undecodable",)),
    Row("stamps an hour ahead", driver_does("an hour ahead"), hold_s=1.2, refusal=("from the future",), trials=1),
    Row("stamps half a second ahead", driver_does("half a second ahead"), hold_s=1.2, refusal=("from the future",)),
    Row("stamps an hour behind", driver_does("an hour behind"), hold_s=1.2, refusal=("late", "out of order"), trials=1),
    # Others who command.
    Row("second commander", acts.rival, silence=True, refusal=("another commander",), quick=True),
    Row("commander with an old epoch", acts.lose_the_lease, THAW, hold_s=1.5, refusal=("old epoch",), fatal=True),
    Row("commands forged with an old time", acts.forge(-1.0), silence=True, refusal=("late",)),
    Row("commands recorded and replayed", acts.replay_commands, THAW, refusal=("out of order",)),
    Row("datagrams recorded and replayed", acts.replay_datagrams, THAW, trials=1),
    Row("lease copied", acts.forge(0.0), silence=True, refusal=("another commander",), quick=True),
    Row("emergency stop beside an idle ROS joystick", acts.press,
        one_by_one(acts.release, pause(1.0), acts.rest), first=one_by_one(acts.idle_joystick, INSIST),
        stopped_by=(ESTOP,), within_s=BUDGET_S, quick=True),
    Row("commander frozen beside an idle ROS joystick", FREEZE,
        one_by_one(THAW, INSIST, pause(1.0), acts.rest), first=acts.idle_joystick),
    Row("emergency stop", one_by_one(INSIST, acts.press), acts.release, stopped_by=(ESTOP,), within_s=BUDGET_S,
        quick=True),
    Row("emergency stop under motion and neutrals", one_by_one(acts.press, driver_does("waver")), acts.release,
        stopped_by=(ESTOP,), within_s=BUDGET_S, resumes=True, renews=True, quick=True),
    flooded("commands"),
    flooded("samples of 1 MB", quick=True),
    flooded("queries"),
    # Sensors.
    Row("camera freezes", robot_does("camera freezes"), WELL, stopped_by=SEES, within_s=SENSOR_S, resumes=True,
        trials=1),
    Row("lidar freezes", robot_does("lidar freezes"), WELL, stopped_by=SEES, within_s=SENSOR_S, resumes=True,
        quick=True),
    Row("lidar freezes, and the commander drives on", one_by_one(INSIST, robot_does("lidar freezes")),
        one_by_one(driver_does("leave"), pause(0.5), WELL), stopped_by=(FIELD,), within_s=SENSOR_S),
    Row("half a scan", robot_does("half a scan"), WELL, stopped_by=SEES, within_s=SENSOR_S, resumes=True, trials=1),
    Row("black image", robot_does("black image"), WELL, stopped_by=SEES, within_s=SENSOR_S, resumes=True, trials=1),
    Row("camera read never returns", robot_does("camera hangs"), WELL, stopped_by=SEES, within_s=SENSOR_S,
        resumes=True),
    Row("robot's main thread hangs", robot_does("main hangs"), silence=True, hold_s=2.0, trials=1),
    # The learner.
    Row("lira drive killed (kill -9)", KILL, drives=LIRA, setup=FUSION, trials=1),
    Row("lira drive frozen (SIGSTOP)", FREEZE, THAW, hold_s=1.6, drives=LIRA, setup=FUSION, trials=1),
    Row("robot restarted under the learner", acts.end_robot, acts.restart_robot, drives=LIRA, setup=LEARNER,
        stopped_by=(WATCHDOG, FAREWELL), trials=1),
    Row("disk full under labels and record", acts.fill_disk, acts.see_it_told, hold_s=3.0,
        stopped_by=(DRIVER, FAREWELL), drives=LIRA, setup=LEARNER, trials=1),
    Row("link's process killed (kill -9)", acts.link_signal(signal.SIGKILL), acts.restart_link, hold_s=1.0,
        setup=LINK),
    Row("link's process frozen (SIGSTOP)", acts.link_signal(signal.SIGSTOP), acts.link_signal(signal.SIGCONT),
        hold_s=1.0, setup=LINK),
    # The physical robot's drivers.
    Row("robot's process frozen (SIGSTOP)", ROBOT_FREEZE, ROBOT_THAW, hold_s=1.6, stopped_by=(GUARD,),
        budget_s=DRIVERS_S, setup=DRIVERS),
    Row("robot's process killed (kill -9)", acts.robot_signal(signal.SIGKILL), acts.restart_robot,
        stopped_by=(GUARD,), budget_s=DRIVERS_S, setup=DRIVERS, trials=1),
    Row("robot's governor hangs", robot_does("governor hangs"), WELL, stopped_by=(BASE,), budget_s=DRIVERS_S,
        below=BASE, setup=DRIVERS),
    Row("base's driver hangs", robot_does("base hangs"), WELL, stopped_by=(GUARD,), budget_s=DRIVERS_S,
        setup=DRIVERS),
    *map(board_resets, (0.3, 0.6, 1.1, 2.0, 4.0)),
    Row("board reset, then something in the way, and away", one_by_one(INSIST, world_does("board resets 0.6")),
        one_by_one(pause(3.0), OBSTACLE), hold_s=1.0, stopped_by=(BOARD, *NO_DEVICE), below=BOARD, setup=DRIVERS,
        trials=1),
    Row("board heard no more", one_by_one(INSIST, world_does("board mute")), REPAIRED, hold_s=2.5,
        stopped_by=NO_DEVICE, budget_s=WATCHED_S, within_s=WATCHED_S, below=BASE, setup=DRIVERS),
    # Only the firmware's watchdog can stop such a board; meanwhile the driver has found out, and holds whoever insists.
    Row("board hears no more", one_by_one(INSIST, world_does("board deaf")), REPAIRED, hold_s=1.5,
        stopped_by=(BOARD, *NO_DEVICE), budget_s=FIRMWARE_S, within_s=FIRMWARE_S, below=BOARD, setup=DRIVERS),
    Row("board lost for less than a tick", one_by_one(INSIST, world_does("board mute until asked")), hold_s=3.0,
        stopped_by=NO_DEVICE, budget_s=WATCHED_S, within_s=WATCHED_S, below=BASE, setup=DRIVERS, trials=1),
    Row("lidar mute, then something in the way, and away", one_by_one(INSIST, world_does("lidar mute")),
        one_by_one(REPAIRED, OBSTACLE), hold_s=1.5, stopped_by=NO_DEVICE, within_s=WATCHED_S, setup=DRIVERS,
        trials=1),
    Row("lidar unplugged, then something in the way, and away", one_by_one(INSIST, world_does("lidar unplugged")),
        one_by_one(REPAIRED, OBSTACLE), hold_s=1.0, stopped_by=NO_DEVICE, within_s=WATCHED_S, setup=DRIVERS,
        trials=1),
    flooded("samples of 1 MB", DRIVERS),
    # A robot that runs ROS 2.
    Row("commander killed (kill -9) on a robot that runs ROS 2", KILL, setup=ROS2, trials=1),
    flooded("samples of 1 MB", ROS2),
    Row("lira ros2 killed (kill -9)", acts.robot_signal(signal.SIGKILL), acts.restart_robot,
        stopped_by=(CONTROLLER,), budget_s=CONTROLLER_S, below=CONTROLLER, setup=ROS2, trials=1),
    Row("lira ros2 frozen (SIGSTOP)", ROBOT_FREEZE, ROBOT_THAW, hold_s=1.6, stopped_by=(CONTROLLER,),
        budget_s=CONTROLLER_S, below=CONTROLLER, setup=ROS2),
    # The time of day.
    clock_set("robot", HOUR_S, "ahead"),
    clock_set("robot", -HOUR_S, "behind"),
    clock_set("driver", HOUR_S, "ahead"),
    clock_set("driver", -HOUR_S, "behind"),
    # Keys.
    Row("put without a certificate", acts.put_plainly, silence=True, refusal=("links",), setup=KEYED),
    Row("put with a viewer's certificate", acts.put_as(GUEST), silence=True,
        refusal=("messages",), setup=KEYED),
    Row("datagrams recorded and replayed where there are keys", acts.replay_datagrams, THAW, setup=KEYED, trials=1),
    Row("put with another operator's certificate", acts.put_as(RIVAL), silence=True,
        refusal=("another commander",), setup=KEYED),
    Row("put in the commander's name with another's certificate", acts.put_in_name(RIVAL, LAPTOP), silence=True,
        refusal=("messages",), setup=KEYED),
    Row("emergency stop released by a viewer", one_by_one(acts.press, driver_does("waver")), acts.release_as(GUEST),
        stopped_by=(ESTOP,), within_s=BUDGET_S, setup=KEYED, fatal=True),
    Row("certificate runs out", nothing, first=one_by_one(INSIST, acts.wait_expired), hold_s=2.0, shut_out_s=1.0,
        within_s=1.35, certificate=BRIEF, setup=KEYED, fatal=True, trials=1),
    Row("name revoked", one_by_one(INSIST, acts.revoke(LEAVER)), hold_s=6.0, shut_out_s=5.0,
        within_s=5.35, certificate=LEAVER, setup=KEYED, fatal=True, trials=1),
)  # fmt: skip
