"""A recording told on a bus again is, recorded again, the same; screens and viewers take it for the robot."""

import threading
import time
import uuid

import pytest
from samples import battery, drive, odom, sample, write

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP, ask_info
from lira.hal.bus.topics import BATTERY, CAMERA, DECISION, ODOM, SCAN
from lira.tools.bench.parts.samples import DECISION as A_DECISION
from lira.tools.launch.processes import free_port
from lira.tools.recording.player import Player
from lira.tools.recording.reader import Recording


@pytest.fixture
def buses():
    name, endpoint = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"
    robot, watch = Bus(name, listen=endpoint), None
    try:
        watch = Bus(name, connect=endpoint, watch=True)
        yield robot, watch
    finally:
        if watch is not None:
            watch.close()
        robot.close()


def of(key, samples):
    return [(each.payload, each.attachment) for each in samples if each.key == key]


def playing(player, *arguments):
    stop = threading.Event()
    thread = threading.Thread(target=player.run, args=[stop, *arguments])
    thread.start()
    return stop, thread


def test_what_is_played_is_heard_to_the_byte_in_its_order(tmp_path, buses):
    robot, watch = buses
    write(tmp_path / "rec", drive(3))
    tap, heard = watch.tap(), []
    _, thread = playing(Player(Recording(tmp_path / "rec"), robot))
    until_s = time.monotonic() + 20.0
    while len([each for each in heard if each.key != BATTERY.key]) < 120 and time.monotonic() < until_s:
        heard += tap.poll()
        time.sleep(0.01)
    thread.join(10.0)
    sent = list(drive(3))
    for key in (ODOM.key, SCAN.key, CAMERA.key):  # one may overtake another, as on any bus
        assert of(key, heard) == of(key, sent)


def test_who_asks_is_told_of_the_robot_and_comes_late_hears_what_is_latched(tmp_path, buses):
    robot, watch = buses
    write(tmp_path / "rec", [battery(5.0), *(odom(number, 5.0) for number in range(5000))])
    player = Player(Recording(tmp_path / "rec"), robot, speed=0.5)
    stop, thread = playing(player, 1.0)
    try:
        info = ask_info(watch, 10.0)
        assert (info.profile.name, info.mode) == ("thesis-sim", LOCKSTEP)
        reader, until_s = watch.reader(BATTERY), time.monotonic() + 10.0
        while reader.newest() is None:
            assert time.monotonic() < until_s
            time.sleep(0.05)
    finally:
        stop.set()
        thread.join(10.0)
    assert not thread.is_alive()


def test_the_alignment_is_that_of_the_recording_times_the_speed(tmp_path, buses):
    robot, _ = buses
    write(tmp_path / "rec", [odom(number, 5.0) for number in range(600)])  # 0.6 s
    began_s = time.monotonic()
    player = Player(Recording(tmp_path / "rec"), robot, speed=0.5)
    player.run(threading.Event())
    assert player.told == 600
    assert time.monotonic() - began_s > 1.2


def test_it_steps_from_decision_to_decision_and_what_nobody_knows_is_left_out(tmp_path, buses):
    robot, _ = buses
    unknown = type(odom(0, 5.0))("their/topic", "their_msgs/msg/Thing", b"\0\1\0\0", None, 0.0)
    decision = sample(DECISION, A_DECISION)
    write(tmp_path / "rec", [odom(0, 5.0), unknown, decision, odom(1, 5.1), decision, odom(2, 5.2)])
    player, asked = Player(Recording(tmp_path / "rec"), robot), []

    def ask(each):
        asked.append(each.key)
        return len(asked) < 2

    player.step(threading.Event(), ask)
    assert asked == ["lira/decision"] * 2
    assert player.told == 4
