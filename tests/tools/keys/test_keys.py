"""Keys: who has none, or not the right ones, moves nothing."""

import stat
import threading
import time

import pytest
from keyed_bed import GO, NAME, drive_until, make_keys, plain_session, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import KEY, ROLES, load_keys
from lira.hal.bus.services import look_at_estop, press_estop
from lira.hal.bus.topics import APPLIED, CMD_VEL, DIAGNOSTICS, JOY, OPERATOR, SIM_STATE
from lira.hal.client.connect import open_remote
from lira.hal.errors import BusError, ConfigError
from lira.hal.messages import STOP, Joy, OperatorRequest, Reason, Request
from lira.hal.messages.ros.codec import encode
from lira.tools.authority import init
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = make_keys(tmp_path_factory.mktemp("keys") / "keys")
    init(folder.parent / "others")
    return folder


@pytest.mark.parametrize("who", ["laptop", "anna"])
def test_who_is_enrolled_drives_on_two_encrypted_links(folder, robot, who):
    bus = Bus(NAME, connect=robot[0], keys=load_keys(folder / who))
    client = open_remote(bus)
    deadline_s = time.monotonic() + 5.0
    while bus.links() != 2 and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert bus.links() == 2
    assert sorted(str(link.dst).split("/")[0] for link in bus._session.info.links()) == ["quic", "tls"]
    drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
    drive_until(client, GO, lambda applied: applied.twist == GO)
    client.close()
    assert bus.close()


def test_a_viewer_sees_and_stops_but_does_not_drive(folder, robot):
    endpoint, inner = robot
    bus = Bus(NAME, connect=endpoint, keys=load_keys(folder / "guest"))
    try:
        assert look_at_estop(bus).refused == {}
        applied, forger = bus.reader(APPLIED), bus.publisher(CMD_VEL)
        deadline_s = time.monotonic() + 5.0
        while applied.newest() is None and time.monotonic() < deadline_s:
            time.sleep(0.02)
        assert applied.newest() is not None
        for step in range(40):
            forger.put(STOP if step < 20 else GO, inner.now())
            time.sleep(0.02)
        assert inner.state().x_m == 0.0
        assert applied.newest().message.reason is Reason.NO_COMMAND
        assert press_estop(bus).pressed
    finally:
        assert bus.close()


def test_joy_and_requests_come_from_who_may_drive_and_from_no_viewer(folder, robot):
    endpoint, _ = robot
    watch = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"), watch=True)
    anna = Bus(NAME, connect=endpoint, keys=load_keys(folder / "anna"))
    guest = Bus(NAME, connect=endpoint, keys=load_keys(folder / "guest"))
    joys, requests = watch.reader(JOY, depth=64), watch.reader(OPERATOR, depth=64)
    pads = [(bus, bus.publisher(JOY), bus.publisher(OPERATOR)) for bus in (anna, guest)]
    heard = []
    try:
        deadline_s = time.monotonic() + 15.0
        while time.monotonic() < deadline_s and len({type(r.message) for r in heard}) < 2:
            for _, joy, operator in pads:
                joy.put(Joy(0.0, (1.0,), (1,)), 0.0)
                operator.put(OperatorRequest(Request.PAUSE), 0.0)
            time.sleep(0.02)
            heard += [*joys.poll(), *requests.poll()]
        # Both have long been connected: what the guest sends now, the robot lets nobody hear.
        for _ in range(50):
            for _, joy, operator in pads:
                joy.put(Joy(0.0, (1.0,), (1,)), 0.0)
                operator.put(OperatorRequest(Request.PAUSE), 0.0)
            time.sleep(0.02)
        heard += [*joys.poll(), *requests.poll()]
        assert guest.peers() == anna.peers() == 1
        assert {type(r.message) for r in heard} == {Joy, OperatorRequest}
        assert {r.attachment.epoch for r in heard} == {anna.epoch}
    finally:
        for bus in (watch, anna, guest):
            bus.close()


def test_a_plain_zenoh_put_without_a_certificate_moves_nothing(robot):
    endpoint, inner = robot
    session = plain_session(endpoint)
    for step in range(40):
        session.put(f"{NAME}/cmd_vel", encode(STOP if step < 20 else GO))
        time.sleep(0.02)
    assert session.info.peers_zid() == []
    assert inner.state().x_m == 0.0
    # It takes its time while it tries to connect.
    threading.Thread(target=session.close, daemon=True).start()


def test_who_is_kept_out_of_a_served_twin_is_counted(folder, tmp_path, monkeypatch):
    endpoint = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("LIRA_KEYS", str(folder / "robot"))
    command = lira_command("twin", "--name", NAME, "--listen", endpoint, "--renderer", "tiny")
    with ChildProcess("twin", command, tmp_path / "twin.log") as twin:
        assert "encrypted" in twin.wait_ready("serves", 40.0)
        bus = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
        viewer = Bus(NAME, connect=endpoint, keys=load_keys(folder / "guest"))
        diagnostics, state = bus.reader(DIAGNOSTICS), bus.reader(SIM_STATE)

        def refused(kind):
            newest = diagnostics.newest()
            link = None if newest is None else next(s for s in newest.message.status if s.name.endswith("link"))
            return -1 if link is None else int(dict(link.values)[f"refused {kind}"])

        wait_for(lambda: refused("links") == refused("messages") == 0 and state.newest() is not None, 10.0)
        began_m = state.newest().message.x_m
        plain = plain_session(endpoint)
        forger = viewer.publisher(CMD_VEL)
        wait_for(lambda: forger.matching, 5.0)
        for step in range(40):
            for put in (lambda t: plain.put(f"{NAME}/cmd_vel", encode(t)), lambda t: forger.put(t, 0.0)):
                put(STOP if step < 20 else GO)
            time.sleep(0.02)
        wait_for(lambda: refused("links") >= 1 and refused("messages") == 40, 10.0)
        assert state.newest().message.x_m == began_m
        assert twin.output().count("without a valid certificate") == 1
        threading.Thread(target=plain.close, daemon=True).start()
        assert viewer.close()
        assert bus.close()


def test_a_certificate_of_another_authority_is_refused(folder, robot):
    bus = Bus(NAME, connect=robot[0], keys=load_keys(folder.parent / "others" / "laptop"))
    try:
        with pytest.raises(BusError, match="answers"):
            look_at_estop(bus, 1.0)
        assert bus.peers() == 0
    finally:
        bus.close()


@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0", "7447"])
def test_an_address_without_a_port_is_told_before_keys_are(listen, monkeypatch):
    monkeypatch.delenv("LIRA_KEYS", raising=False)
    with pytest.raises(ConfigError, match="is no address"):
        Bus(NAME, listen=listen)


def test_without_keys_a_robot_listens_to_this_machine_only(folder, monkeypatch):
    port = free_port()
    monkeypatch.delenv("LIRA_KEYS", raising=False)
    with pytest.raises(ConfigError, match=r"could drive the robot.*lira keys init.*--insecure"):
        Bus(NAME, listen=f"0.0.0.0:{port}")
    bus = Bus(NAME, listen=f"0.0.0.0:{port}", insecure=True)
    assert not bus.encrypted
    assert bus.close()
    monkeypatch.setenv("LIRA_KEYS", str(folder / "robot"))
    bus = Bus(NAME, listen=f"0.0.0.0:{port}")
    assert bus.encrypted
    assert bus.close()


def test_the_verb_makes_closed_keys_and_never_writes_over(tmp_path, capsys):
    folder = tmp_path / "keys"
    assert main(["keys", "init", str(folder)]) == 0
    assert main(["keys", "enroll", "bob", str(folder)]) == 0
    for name in ("authority/robot", "authority/bob", "robot", "laptop", "bob"):
        assert stat.S_IMODE((folder / name / KEY).stat().st_mode) == 0o600
    assert (folder / "robot" / ROLES).read_text() == "laptop operator\nbob operator\n"
    assert main(["keys", "init", str(folder)]) == 2
    assert main(["keys", "enroll", "bob", str(folder)]) == 2
    assert main(["keys", "enroll", "../bob", str(folder)]) == 2
    capsys.readouterr()
    assert main(["keys", "show", str(folder)]) == 0
    assert "729" in (shown := capsys.readouterr().out)
    assert "29" in shown
    (folder / "bob" / KEY).chmod(0o644)
    with pytest.raises(ConfigError, match="chmod 600"):
        load_keys(folder / "bob")
    (folder / "bob" / KEY).unlink()
    with pytest.raises(ConfigError, match=r"key.pem is missing"):
        load_keys(folder / "bob")


def test_a_folder_of_keys_is_for_no_repository_and_others_are_left_as_they_are(folder, tmp_path):
    assert (folder / ".gitignore").read_text() == "*\n"
    init(tmp_path)
    assert not (tmp_path / ".gitignore").exists()
