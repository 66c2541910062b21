"""Peers that send as much as they can, and a driver that is killed meanwhile: the wheels stop in time all the same."""

import time

import pytest
from scene import Scene, kill, moved_on_s

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info
from lira.hal.bus.topics import CMD_VEL, ESTOP_PRESS, ESTOP_RELEASE, INFO, RESET, TELEOP, TOPICS
from lira.tools.stop_test.starved import longest_s, waits_s

FLOOD_S = 1.0
BUDGET_S = 0.35
ATTEMPTS = 3  # the attackers take the robot's processors, too, which on a robot nobody does
STARVED_S = 0.02
MEMORY_MB = 300
EVERYWHERE = [topic.key for topic in TOPICS if topic.key != "estop"]  # a flood there is a press
SMALL = ("flood", 52, [CMD_VEL.key])
LARGE = ("flood", 1_000_000, [CMD_VEL.key])
HUGE = ("flood", 50_000_000, EVERYWHERE)
QUERIES = ("ask", 60, [INFO, RESET, ESTOP_PRESS, ESTOP_RELEASE])
LONG_QUERIES = ("ask", 1_000_000, [INFO, RESET, ESTOP_PRESS, ESTOP_RELEASE])

SCENES = [
    ("null", [SMALL, SMALL]),
    ("null", [HUGE]),
    ("null", [LONG_QUERIES]),
    ("twin", [("flood", 1_000_000, EVERYWHERE), QUERIES]),
    ("wire", [LARGE, LARGE]),
    ("ros2", [LARGE, ("flood", 1_000_000, [TELEOP.key]), QUERIES]),
]


@pytest.mark.alone
@pytest.mark.parametrize(("kind", "attacks"), SCENES)
def test_whoever_floods_the_wheels_stop_in_time_and_memory_stays_small(kind, attacks, tmp_path):
    for attempt in range(ATTEMPTS):
        late_s, waited_s = stop_under(attacks, kind, tmp_path / str(attempt))
        if late_s <= BUDGET_S:
            return
        assert waited_s > STARVED_S, f"{late_s:.3f} s"
    pytest.fail(f"{late_s:.3f} s, and so each time")


def stop_under(attacks, kind, folder):
    """Kill the driver under a flood. How long the wheels moved on, and the robot lacked a processor meanwhile."""
    folder.mkdir()
    with Scene(kind, folder) as scene:
        before_mb = scene.memory_mb()
        driver, commands = scene.driver()
        assert scene.wait(scene.moves, 10.0)
        attackers = scene.attackers(attacks)
        time.sleep(FLOOD_S)
        scene.wait(scene.moves, 1.5)  # a flood may keep the driver's commands away; then it stands
        waits = waits_s([scene.robot.pid])
        kill(driver)
        assert scene.wait(lambda: not scene.moves(), 5.0)
        time.sleep(0.3)
        waited_s = longest_s(waits, waits_s([scene.robot.pid]))
        assert scene.robot.status() is None
        assert scene.memory_mb() - before_mb < MEMORY_MB / 3
        assert scene.memory_mb() < MEMORY_MB
        for attacker in attackers:
            kill(attacker)
        bus = Bus(scene.name, connect=scene.endpoint)
        assert ask_info(bus, 5.0).profile.name
        assert bus.close()
        return moved_on_s(scene.orders(), commands), waited_s
