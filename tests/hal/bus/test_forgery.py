"""Without keys, too, the robot alone says what it says, and commands reach nobody else; bare peers are told apart."""

import json
import time
from contextlib import contextmanager

import numpy as np
import pytest
import zenoh
from wiring import joined, real_time_null, remote, served, wait_for
from zenoh.handlers import FifoChannel

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.security.access import access_list
from lira.hal.bus.security.keys import Role
from lira.hal.bus.services import look_at_estop, press_estop
from lira.hal.bus.topics import APPLIED, CMD_VEL, ESTOP_LOOK, ESTOP_PRESS, INFO, SCAN, TELEOP, named
from lira.hal.messages import STOP, Applied, Command, LaserScan, Reason, Source, Twist
from lira.hal.messages.ros.codec import encode

GO, BACK = Twist(0.5, 0.0), Twist(-0.2, 0.0)
FORGED_M = 77.0


@contextmanager
def stranger(robot, mode="client", *, stamps=True):
    """A session that keeps to none of our rules."""
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "connect/endpoints": [f"tcp/{robot.endpoint}"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "timestamping/enabled": stamps,
    }.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    try:
        wait_for(lambda: len(session.info.peers_zid()) == 1)
        yield session
    finally:
        session.close()


def get_going(client):
    wait_for(lambda: client.drive(Command(STOP, client.now())).reason is Reason.OK)
    wait_for(lambda: client.drive(Command(GO, client.now())).twist == GO)


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_nobody_else_answers_or_speaks_for_the_robot(mode):
    forged_state = b'{"state": "emergency", "refused": {"forged": 1}}'
    with served(real_time_null()) as robot, joined(robot) as bus, stranger(robot, mode) as session:

        def answer(query):
            asked = parse_attachment(bytes(query.attachment)) if query.attachment else Attachment(0, 0, 0)
            query.reply(query.key_expr, forged_state, attachment=asked.to_bytes())

        keys = [f"{robot.name}/{key}" for key in (INFO, ESTOP_PRESS, ESTOP_LOOK, "**")]
        declared = [session.declare_queryable(key, answer, complete=True) for key in keys]
        watch = Bus(robot.name, connect=robot.endpoint, watch=True)
        scans, results = watch.reader(SCAN, 64), watch.reader(APPLIED, 64)
        wait_for(lambda: results.newest() is not None)
        for _ in range(5):
            assert "forged" not in look_at_estop(bus).refused
            session.put(f"{robot.name}/scan", encode(LaserScan(0.0, 0.0, 0.1, 0.1, FORGED_M, np.ones(3, np.float32))))
            session.put(f"{robot.name}/cmd_vel/applied", encode(Applied(BACK, 0.0, Source.TELEOP)))
            time.sleep(0.05)
        assert press_estop(bus).pressed
        assert "forged" not in press_estop(bus).refused
        assert all(received.message.range_max != FORGED_M for received in scans.poll())
        assert all(received.message.twist != BACK for received in results.poll())
        assert watch.close()
        assert declared


def test_commands_reach_the_robot_and_nobody_else():
    with served(real_time_null()) as robot, remote(robot) as client, stranger(robot) as session:
        everything = session.declare_subscriber(f"{robot.name}/**", FifoChannel(4096))
        get_going(client)
        wait_for(lambda: robot.inner.state().linear_m_s > 0.0)
        heard = []
        while (sample := everything.try_recv()) is not None:
            heard.append(sample)
        keys = {str(sample.key_expr).partition("/")[2] for sample in heard}
        assert APPLIED.key in keys
        assert not keys & {CMD_VEL.key, TELEOP.key}
        secret = client.bus.epoch.to_bytes(8, "little")
        assert not any(secret in bytes(s.payload) + bytes(s.attachment or b"") for s in heard)


def test_of_two_bare_peers_the_second_is_refused_until_the_first_is_silent():
    with served(real_time_null()) as robot, stranger(robot) as first, stranger(robot) as second:
        key = f"{robot.name}/{CMD_VEL.key}"

        def drive(*wishes):
            for _ in range(25):
                for session, twist in wishes:
                    session.put(key, encode(twist))
                time.sleep(0.02)

        drive((first, STOP))
        drive((first, GO), (second, BACK))
        assert robot.inner.state().linear_m_s == GO.linear_m_s
        assert robot.governed.refused["another commander"] >= 20
        with joined(robot) as bus:
            assert look_at_estop(bus).refused["another commander"] >= 20
        time.sleep(robot.inner.profile.control.lease_s)
        drive((second, STOP))
        drive((second, BACK))
        assert robot.inner.state().linear_m_s == BACK.linear_m_s


def test_who_cannot_be_told_apart_does_not_drive():
    with served(real_time_null()) as robot, stranger(robot, stamps=False) as session:
        for twist in [STOP] * 20 + [GO] * 20:
            session.put(f"{robot.name}/cmd_vel", encode(twist))
            time.sleep(0.01)
        assert robot.inner.state().x_m == 0.0


def test_a_name_is_the_last_part_of_a_key():
    assert named(CMD_VEL, "anna").key == "cmd_vel/by/anna"
    keys = {"rosbot/cmd_vel/teleop/by/laptop-2": "laptop-2", "rosbot/cmd_vel": "", "by/cmd_vel": ""}
    assert {key: Received(None, None, 0.0, key).commander for key in keys} == keys


def test_each_operator_may_put_commands_in_their_own_name_alone():
    access = access_list("r", {"anna": Role.OPERATOR, "bob": Role.OPERATOR, "eve": Role.VIEWER, "ros": Role.BRIDGE})
    rules = {rule["id"]: rule for rule in access["rules"]}
    granted = {policy["subjects"][0]: policy["rules"] for policy in access["policies"]}

    def may(who, message, key):
        wanted = [rules[name] for name in granted[who]]
        return any(message in r["messages"] and r["flows"] == ["ingress"] and key in r["key_exprs"] for r in wanted)

    def who_may(message, *keys):
        return {key: {who for who in granted if may(who, message, f"r/{key}")} for key in keys}

    assert who_may("put", "cmd_vel", "cmd_vel/teleop", "cmd_vel/by/anna", "cmd_vel/teleop/by/bob") == {
        "cmd_vel": {"ros"},
        "cmd_vel/teleop": {"ros"},
        "cmd_vel/by/anna": {"anna"},
        "cmd_vel/teleop/by/bob": {"bob"},
    }
    assert who_may("put", "estop", "joy", "scan", "battery", "cmd_vel/applied") == {
        "estop": {"anna", "bob", "ros"},
        "joy": {"anna", "bob"},
        "scan": set(),
        "battery": set(),
        "cmd_vel/applied": set(),
    }
    assert who_may("query", "estop/press", "estop/release", "sim/reset") == {
        "estop/press": set(granted),
        "estop/release": {"anna", "bob"},
        "sim/reset": {"anna", "bob"},
    }
