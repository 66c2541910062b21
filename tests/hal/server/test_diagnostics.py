"""What the HAL server says about itself."""

import time

from wiring import joined, new_endpoint, ready, real_time_null, remote, served, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import CMD_VEL, DIAGNOSTICS
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, DiagnosticStatus
from lira.hal.port import DeviceHealth
from lira.hal.profile import load_profile
from lira.hal.safety.governed import FIELD_OFF
from lira.hal.server.diagnostics import NO_DATAGRAMS, PATIENCE_S, WARN, LinkWatch
from lira.hal.testing import NullRobot
from lira.tools.launch.link_fault import Relay


def test_one_link_is_told_when_it_stays_so():
    watch = LinkWatch()
    assert watch.look(0, 0.0) == ""
    assert watch.look(1, 1.0) == ""
    assert watch.look(1, 1.0 + PATIENCE_S - 0.1) == ""
    assert watch.look(1, 1.0 + PATIENCE_S) == NO_DATAGRAMS
    assert watch.look(0, 9.0) == ""
    assert watch.look(2, 10.0) == ""
    assert watch.look(2, 10.0 + PATIENCE_S) == NO_DATAGRAMS


def test_a_watcher_needs_but_one_link():
    with served(real_time_null()) as robot, joined(robot) as peer:
        watcher = Bus(robot.name, connect=robot.endpoint, watch=True)
        reader = watcher.reader(DIAGNOSTICS)
        wait_for(lambda: robot._bus.links() == 3)
        wait_for(lambda: (link := status(reader, "link")) is not None and ("links", "3") in link.values)
        assert robot._bus.short_peers() == peer.short_peers() == 0
        assert watcher.close()


def status(reader, part):
    newest = reader.newest()
    return None if newest is None else next(s for s in newest.message.status if s.name.endswith(part))


def test_what_is_refused_and_the_state_are_published():
    with served(real_time_null()) as robot, remote(robot) as client, joined(robot) as rival:
        reader = rival.reader(DIAGNOSTICS)
        client.drive(Command(STOP, client.now()))
        commands = ready(rival)
        for _ in range(3):
            commands.put(STOP, client.now())
            rival.put_raw(CMD_VEL, b"nonsense")

        def told():
            found = status(reader, "governor")
            return found is not None and {"refused: another commander", "refused: cmd_vel: undecodable"} <= {
                key for key, value in found.values if value != "0"
            }

        wait_for(told)
        assert ("links", "4") in status(reader, "link").values


def test_it_says_that_datagrams_do_not_get_through_and_still_drives(capfd):
    with served(real_time_null()) as robot:
        front = new_endpoint()
        with Relay(int(front.split(":")[1]), int(robot.endpoint.split(":")[1])) as relay:
            relay.faults.lost = 1.0
            bus = Bus(robot.name, connect=front)
            client = open_remote(bus)
            reader = bus.reader(DIAGNOSTICS)
            wait_for(lambda: client.drive(Command(STOP, client.now())).reason == "ok")
            wait_for(lambda: (link := status(reader, "link")) is not None and link.level == WARN, 10.0)
            assert status(reader, "link").message == NO_DATAGRAMS
            wait_for(lambda: client.drive(Command(STOP, client.now())).reason == "ok")
            client.close()
            assert bus.close()
    assert capfd.readouterr().err.count("UDP does not get through") == 1


class Lidarless(NullRobot):
    """It is to be driven without a lidar, and has lost its base twice."""

    def device_health(self):
        return DeviceHealth(losses=2, absent=("lidar",))


def test_that_the_field_is_off_without_a_lidar_is_said_once_and_on_diagnostics(capfd):
    inner = Lidarless(load_profile("rosbot2"), time.monotonic, time.sleep)
    with served(inner) as robot, joined(robot) as bus:
        reader = bus.reader(DIAGNOSTICS)
        wait_for(lambda: status(reader, "governor") is not None)
        told = status(reader, "governor")
        assert told.level == WARN
        assert ("protective field", FIELD_OFF) in told.values
        assert ("device losses", "2") in told.values
    assert capfd.readouterr().err.count(FIELD_OFF) == 1


class TellsOfItself(NullRobot):
    def diagnostics(self):
        return (DiagnosticStatus(1, "lidar", "the unit warns of 0x0042", (("rate Hz", "10.01"),)),)


def test_what_a_robots_devices_say_of_themselves_is_published():
    robot = TellsOfItself(load_profile("thesis-sim"), time.monotonic, time.sleep)
    with served(robot) as there, joined(there) as peer:
        reader = peer.reader(DIAGNOSTICS)
        wait_for(lambda: status(reader, "lidar") is not None)
        told = status(reader, "lidar")
        assert told.name == f"{there.name}: lidar"
        assert (told.level, told.message, told.values) == (1, "the unit warns of 0x0042", (("rate Hz", "10.01"),))
