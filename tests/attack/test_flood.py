"""Peers that send as much as they can, and a driver that is killed meanwhile: the wheels stop in time all the same."""

import time

import pytest
from scene import BUDGET_S, Scene, begin, kill, moved_on_s

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info
from lira.hal.bus.topics import CMD_VEL, ESTOP_PRESS, ESTOP_RELEASE, INFO, RESET, TELEOP, TOPICS
from lira.tools.stop_test.starved import longest_s, waits_s

FLOOD_S = 0.7
ATTEMPTS = 3  # the attackers take the robot's processors, too, which on a robot nobody does
STARVED_S = 0.02
MEMORY_MB = 300
EVERYWHERE = [topic.key for topic in TOPICS if topic.key != "estop"]  # a flood there is a press
SMALL = ("flood", 52, [CMD_VEL.key])
LARGE = ("flood", 1_000_000, [CMD_VEL.key])
HUGE = ("flood", 50_000_000, EVERYWHERE)
QUERIES = ("ask", 60, [INFO, RESET, ESTOP_PRESS, ESTOP_RELEASE])
LONG_QUERIES = ("ask", 1_000_000, [INFO, RESET, ESTOP_PRESS, ESTOP_RELEASE])

SCENES = {
    "null": [[SMALL, SMALL], [HUGE], [LONG_QUERIES]],
    "twin": [[("flood", 1_000_000, EVERYWHERE), QUERIES]],
    "wire": [[LARGE, LARGE]],
    "ros2": [[LARGE, ("flood", 1_000_000, [TELEOP.key]), QUERIES]],
}


@pytest.mark.alone
@pytest.mark.parametrize("kind", SCENES)
def test_whoever_floods_the_wheels_stop_in_time_and_memory_stays_small(kind, tmp_path):
    with Scene(kind, tmp_path) as scene:
        before_mb = scene.memory_mb()
        for attacks in SCENES[kind]:
            assert any(stops_in_time_under(attacks, scene) for _ in range(ATTEMPTS))
            assert scene.robot.status() is None
            assert scene.memory_mb() - before_mb < MEMORY_MB / 3
            assert scene.memory_mb() < MEMORY_MB
            bus = Bus(scene.name, connect=scene.endpoint)
            assert ask_info(bus, 5.0).profile.name
            assert bus.close()


def stops_in_time_under(attacks, scene):
    """Kill the driver under a flood. Whether the wheels stop in time; if not, the robot had no processor to do so."""
    attackers = scene.attackers(attacks)
    driver, commands = scene.driver()
    assert scene.wait(scene.moves, 10.0)
    for attacker in attackers:
        begin(attacker)
    time.sleep(FLOOD_S)
    scene.wait(scene.moves, 1.5)  # a flood may keep the driver's commands away; then it stands
    waits = waits_s([scene.robot.pid])
    kill(driver)
    assert scene.wait(lambda: not scene.moves(), 5.0)
    time.sleep(0.3)
    waited_s = longest_s(waits, waits_s([scene.robot.pid]))
    for attacker in attackers:
        kill(attacker)
    late_s = moved_on_s(scene.orders(), commands)
    assert late_s <= BUDGET_S or waited_s > STARVED_S, f"{late_s:.3f} s"
    return late_s <= BUDGET_S
