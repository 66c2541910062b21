"""Keys end: with their certificate, and when they are revoked, also for who is just driving."""

import time
from contextlib import contextmanager
from datetime import timedelta

import pytest
from keyed_bed import GO, NAME, drive_until, make_keys, serving, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import CA, CERTIFICATE, KEY, ROLES, load_keys
from lira.hal.bus.services import look_at_estop
from lira.hal.client.connect import open_remote
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Command, Reason
from lira.tools.authority import enroll, enrolled, renew
from lira.tools.cli import main
from lira.tools.launch.processes import free_port

SHUT_OUT_S = 5.0


@pytest.fixture
def folder(tmp_path):
    return make_keys(tmp_path / "keys")


@contextmanager
def driving(folder, endpoint, who):
    bus = Bus(NAME, connect=endpoint, keys=load_keys(folder / who))
    client = open_remote(bus)
    try:
        drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
        drive_until(client, GO, lambda applied: applied.twist == GO)
        yield client
    finally:
        client.close()
        bus.close()


def drive_on(client, seconds):
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        client.drive(Command(GO, client.now()))


def test_a_revoked_laptop_is_shut_out_while_it_drives_and_others_are_not(folder):
    with serving(folder) as (endpoint, inner), driving(folder, endpoint, "laptop") as lost:
        assert main(["keys", "revoke", "laptop", str(folder)]) == 0
        drive_on(lost, SHUT_OUT_S)
        assert lost.bus.links() == 0
        stood_m = inner.state().x_m
        with driving(folder, endpoint, "anna"):
            assert inner.state().x_m > stood_m
        still_m = inner.state().x_m
        drive_on(lost, 1.0)
        assert lost.bus.links() == 0
        assert inner.state().linear_m_s == 0.0
        assert inner.state().x_m - still_m < 0.3
        with pytest.raises(BusError, match="answers"):
            look_at_estop(lost.bus, 0.5)
        again = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
        assert again.peers() == 0
        assert again.close()


def test_who_is_enrolled_while_the_robot_runs_drives(folder):
    with serving(folder) as (endpoint, _):
        enroll(folder, "bob")
        with driving(folder, endpoint, "bob") as client:
            assert client.drive(Command(GO, client.now())).commander == "bob"


def test_links_end_with_their_certificate(folder):
    life = timedelta(seconds=8)
    enroll(folder, "brief", life=life)
    ends_s = time.monotonic() + life.total_seconds()
    with serving(folder) as (endpoint, inner), driving(folder, endpoint, "brief") as client:
        drive_on(client, ends_s + 1.0 - time.monotonic())
        wait_for(lambda: client.bus.links() == 0, 2.0)
        assert inner.state().linear_m_s == 0.0
        renew(folder, "brief")
        drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
        drive_until(client, GO, lambda applied: (applied.twist, applied.commander) == (GO, "brief"))


def test_a_robot_whose_keys_are_broken_lets_nobody_in_says_so_and_comes_back(folder):
    robot = Bus(NAME, listen=f"127.0.0.1:{free_port()}", keys=load_keys(folder / "robot"))
    laptop = Bus(NAME, connect=robot.endpoint, keys=load_keys(folder / "laptop"))
    try:
        assert laptop.peers() == 1
        roles = folder / "robot" / ROLES
        good = roles.read_text()
        roles.write_text(good + "half a li")
        wait_for(lambda: "half a li" in robot.trouble, SHUT_OUT_S)
        wait_for(lambda: laptop.peers() == 0, SHUT_OUT_S)
        roles.write_text(good)
        wait_for(lambda: laptop.peers() == 1 and robot.trouble == "", SHUT_OUT_S)
    finally:
        laptop.close()
        robot.close()


def test_show_names_roles_days_and_what_ends_soon(folder, capsys):
    enroll(folder, "brief", life=timedelta(days=3))
    assert main(["keys", "enroll", "nav2", str(folder), "--bridge", "--days", "90"]) == 0
    assert main(["keys", "revoke", "anna", str(folder)]) == 0
    capsys.readouterr()
    assert main(["keys", "show", str(folder)]) == 0
    rows = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()[2:]}
    assert rows["brief"].endswith("ends soon: lira keys renew brief")
    assert [rows[name].split()[1] for name in ("robot", "laptop", "guest", "nav2", "anna")] == [
        *("robot", "operator", "viewer", "bridge", "revoked")
    ]
    days = {peer.name: peer.days_left for peer in enrolled(folder)}
    assert days == {"robot": 729, "laptop": 29, "guest": 29, "nav2": 89, "anna": 29, "brief": 2}


def test_renewing_keeps_name_key_and_authority(folder):
    before = {name: (folder / "laptop" / name).read_bytes() for name in (CA, CERTIFICATE, KEY)}
    assert main(["keys", "renew", "laptop", str(folder), "--days", "100"]) == 0
    after = {name: (folder / "laptop" / name).read_bytes() for name in (CA, CERTIFICATE, KEY)}
    assert [name for name in before if before[name] != after[name]] == [CERTIFICATE]
    assert next(peer.days_left for peer in enrolled(folder) if peer.name == "laptop") == 99


@pytest.mark.parametrize(
    "words",
    [
        ["revoke", "nobody"],
        ["renew", "nobody"],
        ["revoke", "robot"],
        ["enroll", "authority"],
        ["enroll", "../bob"],
        ["enroll", "anna"],
    ],
)
def test_what_cannot_be_done_is_said_and_changes_nothing(folder, words, capsys):
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert main(["keys", *words, str(folder)]) == 2
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("days", ["0", "1e3", "-1", "99999", "soon"])
def test_days_are_a_number_of_days(folder, days):
    assert main(["keys", "enroll", "bob", str(folder), "--days", days]) == 2
    assert not (folder / "bob").exists()


def test_who_was_revoked_stays_so_and_may_come_back_with_new_keys(folder):
    assert main(["keys", "revoke", "anna", str(folder)]) == 0
    assert main(["keys", "revoke", "anna", str(folder)]) == 2
    assert main(["keys", "renew", "anna", str(folder)]) == 2
    (folder / "anna").rename(folder / "old")
    enroll(folder, "anna")
    with serving(folder) as (endpoint, _):
        old = Bus(NAME, connect=endpoint, keys=load_keys(folder / "old"))
        assert old.peers() == 0
        assert old.close()
        with driving(folder, endpoint, "anna"):
            pass
