"""Who may do what: enrolled peers with sessions of their own making take no more than their role gives them."""

import time

import pytest
import zenoh
from keyed_bed import GO, NAME, attacker, drive_until, make_keys, plain_session, replies, tls
from zenoh import ext

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import load_keys
from lira.hal.bus.services import ask_info, look_at_estop, press_estop, release_estop
from lira.hal.bus.topics import BATTERY, ESTOP_LOOK, ESTOP_PRESS, ESTOP_RELEASE, INFO, RESET
from lira.hal.client.connect import open_remote
from lira.hal.errors import BusError, ConfigError
from lira.hal.messages import STOP, BatteryState, Command, Reason, Twist
from lira.hal.messages.ros.codec import encode
from lira.tools.launch.processes import free_port


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_keys(tmp_path_factory.mktemp("keys") / "keys")


@pytest.mark.parametrize("who", ["guest", "anna"])
def test_who_pretends_to_be_the_robot_is_not_believed(folder, who):
    endpoint = f"127.0.0.1:{free_port()}"
    with pytest.raises(ConfigError, match=f"the keys of {who}, which is no robot"):
        Bus(NAME, listen=endpoint, keys=load_keys(folder / who))
    links = {"listen/endpoints": f'["tls/{endpoint}", "quic/{endpoint}"]', "connect/endpoints": "[]"}
    impostor = plain_session(endpoint, **{**tls(folder / who), **links})
    state = b'{"state": "emergency", "refused": {}}'
    answering = impostor.declare_queryable(f"{NAME}/**", lambda query: query.reply(query.key_expr, state))
    client = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
    try:
        with pytest.raises(BusError, match="answers"):
            press_estop(client, 1.5)
        assert client.peers() == 0
    finally:
        client.close()
        answering.undeclare()
        impostor.close()


@pytest.mark.parametrize("mode", ["peer", "client"])
@pytest.mark.parametrize("who", ["guest", "anna"])
def test_nobody_else_answers_for_the_robot(folder, robot, who, mode):
    endpoint, _ = robot
    laptop = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
    forged = b'{"state": "emergency", "refused": {"forged": 1}}'
    try:
        with attacker(folder, endpoint, who, mode) as session:

            def answer(query):
                asked = parse_attachment(bytes(query.attachment)) if query.attachment else Attachment(0, 0, 0)
                query.reply(query.key_expr, forged, attachment=asked.to_bytes())

            keys = (INFO, ESTOP_PRESS, ESTOP_LOOK, "**", "*/press")
            declared = [session.declare_queryable(f"{NAME}/{key}", answer, complete=True) for key in keys]
            time.sleep(0.5)
            for _ in range(5):
                assert "forged" not in look_at_estop(laptop).refused
                assert ask_info(laptop).profile.name == "thesis-sim"
            assert "forged" not in press_estop(laptop).refused
            assert declared
    finally:
        laptop.close()


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_viewer_presses_and_looks_but_releases_and_resets_nothing(folder, robot, mode):
    endpoint, _ = robot
    laptop = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
    try:
        with attacker(folder, endpoint, "guest", mode) as session:
            assert b"emergency" in replies(session, ESTOP_PRESS)[0]
            assert len(replies(session, ESTOP_LOOK)) == len(replies(session, INFO)) == 1
            for key in (ESTOP_RELEASE, RESET, "estop/*", "**"):
                assert replies(session, key, b"{}") == []
            assert look_at_estop(laptop).pressed
        assert release_estop(laptop).state == "stopped"
    finally:
        laptop.close()


@pytest.mark.parametrize("mode", ["peer", "client"])
@pytest.mark.parametrize("who", ["guest", "anna"])
def test_what_is_latched_comes_from_the_robot_alone(folder, who, mode):
    endpoint = f"127.0.0.1:{free_port()}"
    robot = Bus(NAME, listen=endpoint, keys=load_keys(folder / "robot"))
    laptop = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
    try:
        robot.publisher(BATTERY).put(BatteryState(1.0, 12.0), 1.0)
        early = laptop.reader(BATTERY, depth=8)
        with attacker(folder, endpoint, who, mode) as session:
            cache, payload = ext.CacheConfig(max_samples=1), encode(BatteryState(2.0, 3.0))
            forger = ext.declare_advanced_publisher(session, f"{NAME}/battery", cache=cache, publisher_detection=True)
            forger.put(payload)
            time.sleep(0.5)
            late = laptop.reader(BATTERY, depth=8)
            time.sleep(1.0)
            assert {r.message.voltage_v for r in (*early.poll(), *late.poll())} == {12.0}
            forger.undeclare()
    finally:
        laptop.close()
        robot.close()


def test_who_copies_what_is_public_neither_drives_nor_starves_nor_leaves_for_another(folder, robot):
    endpoint, _ = robot
    bus = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
    client = open_remote(bus)
    try:
        drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
        drive_until(client, GO, lambda applied: applied.twist == GO)
        with attacker(folder, endpoint, "anna", "client") as ear, attacker(folder, endpoint, "anna", "client") as mouth:
            everything = ear.declare_subscriber(f"{NAME}/**", zenoh.handlers.FifoChannel(4096))
            results = [attacked(client, mouth) for _ in range(60)]
            heard = drained(everything)
        assert {(a.twist, a.reason, a.commander) for a in results} == {(GO, Reason.OK, "laptop")}
        assert {str(sample.key_expr) for sample in heard} >= {f"{NAME}/cmd_vel/applied"}
        assert not any("/by/" in str(sample.key_expr) for sample in heard)
        secret = bus.epoch.to_bytes(8, "little")
        assert not any(secret in bytes(sample.payload) + bytes(sample.attachment or b"") for sample in heard)
    finally:
        client.close()
        bus.close()


def attacked(client, session):
    """One period of driving, after which the session says other things in the driver's name, as far as it is told."""
    applied, back = client.drive(Command(GO, client.now())), encode(Twist(-0.15, 0.0))
    for key in ("", "/by/laptop", "/by/anna", "/teleop", "/teleop/by/laptop", "/by/*", "/**"):
        for ahead_s, released in ((0.09, False), (0.0, False), (0.0, True)):
            time_ns = round((client.now() + ahead_s) * 1e9)
            copy = Attachment(applied.session, applied.seq + 1, time_ns, -1, released)
            session.put(f"{NAME}/cmd_vel{key}", back, attachment=copy.to_bytes())
    return applied


def drained(subscriber):
    samples = []
    while (sample := subscriber.try_recv()) is not None:
        samples.append(sample)
    return samples
