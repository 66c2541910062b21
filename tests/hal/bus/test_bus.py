"""The bus: what is put comes, the newest wins, garbage is counted, nobody and trouble are said."""

import socket
import threading
import time

import pytest
import zenoh
from wiring import new_endpoint, new_name, paired, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import BATTERY, CMD_VEL, ODOM, TOPICS
from lira.hal.errors import BusError, ConfigError
from lira.hal.messages import BatteryState, Odometry, Twist


@pytest.fixture
def pair():
    with paired() as buses:
        yield buses
        assert buses[1].close()
        assert buses[0].close()  # may be called twice


def odom(x_m):
    return Odometry(1.0, x_m, 0.0, 0.0, 0.0, 0.0)


def test_the_table_has_no_key_twice_and_every_rate_fits_its_age():
    assert len({topic.key for topic in TOPICS}) == len(TOPICS)
    for topic in TOPICS:
        assert topic.rate_hz == 0.0 or 1.0 / topic.rate_hz < topic.max_age_s, topic.key


def test_two_links_are_up(pair):
    robot, client = pair
    wait_for(lambda: robot.links() == client.links() == 2)
    assert robot.peers() == client.peers() == 1


def test_a_message_comes_with_its_attachment_and_only_the_newest_stays(pair):
    robot, client = pair
    reader, publisher = client.reader(ODOM), robot.publisher(ODOM)
    wait_for(lambda: publisher.matching)
    for x_m in (1.0, 2.0, 3.0):
        publisher.put(odom(x_m), time_s=5.25, seq=7, answers=9, released=True)
    wait_for(lambda: (newest := reader.newest()) is not None and newest.message.x_m == 3.0)
    assert reader.poll() == []
    attachment = reader.newest().attachment
    assert (attachment.epoch, attachment.seq, attachment.time_s) == (robot.epoch, 7, 5.25)
    assert (attachment.answers, attachment.released) == (9, True)


def test_a_deep_reader_keeps_the_order(pair):
    robot, client = pair
    reader, publisher = robot.reader(CMD_VEL, depth=4), client.publisher(CMD_VEL)
    wait_for(lambda: publisher.matching)
    for number in range(3):
        publisher.put(Twist(float(number), 0.0), time_s=0.0)
    found = []
    wait_for(lambda: len(found) == 3 or bool(found.extend(reader.poll())))
    assert [received.message.linear_m_s for received in found] == [0.0, 1.0, 2.0]
    assert [received.attachment.seq for received in found] == [1, 2, 3]


def test_a_late_reader_gets_a_latched_value(pair):
    robot, client = pair
    robot.publisher(BATTERY).put(BatteryState(1.0, 11.5), time_s=1.0)
    publisher = robot.publisher(BATTERY)
    publisher.put(BatteryState(2.0, 11.0), time_s=2.0)
    reader = client.reader(BATTERY)
    wait_for(lambda: reader.newest() is not None)
    assert reader.newest().message.voltage_v == 11.0


def test_garbage_is_counted_and_does_not_hide_what_is_good(pair):
    robot, client = pair
    reader, publisher = robot.reader(CMD_VEL, depth=8), client.publisher(CMD_VEL)
    wait_for(lambda: publisher.matching)
    raw = client._session
    for payload in (b"", b"\x00\x01\x00\x00", b"\xff" * 60):
        raw.put(f"{client.robot}/cmd_vel", payload, priority=zenoh.Priority.REAL_TIME, express=True)
    publisher.put(Twist(0.5, 0.0), time_s=0.0)
    wait_for(lambda: reader.newest() is not None and sum(robot.boundary.counts.values()) == 3)
    assert reader.newest().message == Twist(0.5, 0.0)
    assert robot.boundary.counts == {("cmd_vel", "undecodable"): 3}


def test_questions_are_answered_refused_or_missed(pair):
    robot, client = pair
    with pytest.raises(BusError, match=f"no robot named '{client.robot}' answers 'info' at .*lira twin"):
        client.ask("info", timeout_s=0.2)
    questions = robot.questions("info")

    def serve(reply):
        def work():
            found = []

            def answer(question):
                found.append(question)
                reply(question)

            wait_for(lambda: questions.serve(answer) or bool(found))

        thread = threading.Thread(target=work)
        thread.start()
        return thread

    thread = serve(lambda question: question.answer(b"got " + question.payload))
    assert client.ask("info", b"it") == b"got it"
    thread.join()
    assert not client.is_answered("nothing", 1.0)
    thread = serve(lambda question: question.refuse("not today"))
    with pytest.raises(BusError, match="not today"):
        client.ask("info")
    thread.join()


def test_a_port_in_use_is_named_with_the_remedy(pair):
    robot, _ = pair
    with pytest.raises(BusError, match=rf"{robot.endpoint} is already in use.*--listen"):
        Bus(new_name(), listen=robot.endpoint)


@pytest.mark.parametrize(
    "endpoint", ["nowhere", "127.0.0.1", "127.0.0.1:0", "127.0.0.1:99999", "tcp/1.2.3.4:5", ":7447"]
)
def test_bad_addresses_are_refused(endpoint):
    with pytest.raises(ConfigError, match="HOST:PORT"):
        Bus("rosbot", connect=endpoint)


@pytest.mark.parametrize("name", ["", "a/b", "**", "1st", "ros bot", "$*"])
def test_bad_names_are_refused(name):
    with pytest.raises(ConfigError, match="letters"):
        Bus(name, connect="127.0.0.1:7447")


def test_an_address_that_is_not_ours_is_one_clear_line():
    with pytest.raises(BusError) as caught:
        Bus("rosbot", listen="192.0.2.1:7447", insecure=True)
    assert "Cannot assign" in str(caught.value)
    assert ".rs" not in str(caught.value)


def test_whoever_connects_and_says_nothing_does_not_hold_up_the_close():
    endpoint = new_endpoint()
    robot = Bus(new_name(), listen=endpoint)
    host, port = endpoint.split(":")
    with socket.create_connection((host, int(port))):
        time.sleep(0.2)
        assert robot.close()


def test_a_closed_bus_says_so():
    name, endpoint = new_name(), new_endpoint()
    bus = Bus(name, listen=endpoint)
    publisher, reader = bus.publisher(ODOM), bus.reader(ODOM)
    bus.close()
    with pytest.raises(BusError):
        publisher.put(odom(1.0), time_s=1.0)
    with pytest.raises(BusError):
        reader.poll()
