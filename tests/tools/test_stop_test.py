"""The stop test: what it concludes from a journal, its relay, and a part of the matrix with real processes."""

import contextlib
import json
import math
import socket
import threading
import time
from dataclasses import replace
from itertools import groupby

import pytest

from hal.messages import Reason
from hal.profile import load_profile
from tools.cli import main
from tools.processes import free_port
from tools.relay import Narrows, Relay
from tools.stop_test.faults import FAULTS
from tools.stop_test.journal import Given, JournalWriter, Truth, read_journal
from tools.stop_test.matrix import run_matrix
from tools.stop_test.stands import clock_library
from tools.stop_test.verdict import judge, summarize

PROFILE = load_profile("rosbot2")


def drive(until_s, *, age_s=0.02, again_s=None, stop_s=None, reason=Reason.STALE):
    """A journal at 50 Hz: motion until a time, then zero, and perhaps motion again."""
    given, truth, x_m = [], [], 0.0
    for step in range(100):
        now_s = step * 0.02
        moving = now_s < until_s or (again_s is not None and now_s >= again_s)
        pair = (0.2 if moving else 0.0, 0.0)
        given.append(Given(now_s, *pair, min(age_s, now_s) if moving else math.nan, Reason.OK if moving else reason))
        speed_m_s = 0.2 if moving and (stop_s is None or now_s < stop_s) else 0.0
        x_m += 0.02 * speed_m_s
        truth.append(Truth(now_s, x_m, 0.0, speed_m_s))
    return given, truth


def test_time_counts_from_the_last_command_that_was_obeyed():
    verdict = judge(*drive(1.3, age_s=0.24), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert verdict.zero_s == pytest.approx(1.3 - (1.28 - 0.24))
    assert verdict.fault_to_zero_s == pytest.approx(0.3)
    assert verdict.distance_m == pytest.approx(0.2 * 0.24, abs=0.005)
    assert (verdict.stale_obeyed, verdict.moved_unasked) == (0, False)


def test_what_is_old_and_what_moves_again_is_seen():
    stale = judge(*drive(1.9, age_s=0.4), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert stale.stale_obeyed > 0
    again = judge(*drive(1.3, again_s=1.6), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert again.moved_unasked


def test_a_robot_that_never_stops_fails_and_one_that_stands_by_itself_does_not():
    never = judge(*drive(9.0), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert never.zero_s == math.inf
    assert not summarize("x", ("watchdog",), [never], 0.35)["passed"]
    given, truth = drive(9.0, stop_s=1.5)
    frozen = [one for one in given if one.time_s <= 1.0]
    guarded = judge(frozen, truth, broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert 0.4 < guarded.zero_s < 0.6
    assert guarded.stopped_by == "base's guard process"


@pytest.mark.parametrize(
    ("reason", "word"), [(Reason.STALE, "watchdog"), (Reason.OK, "zero commanded"), (None, "base's guard process")]
)
def test_what_stopped_it_is_what_the_governor_noted_and_another_stop_than_expected_fails(reason, word):
    verdict = judge(*drive(1.2, reason=reason), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert verdict.stopped_by == word
    assert summarize("x", (word,), [verdict], 0.35)["passed"]
    assert not summarize("x", ("e-stop",), [verdict], 0.35)["passed"]


def test_a_row_has_the_issues_columns_and_the_worst_decides():
    good, bad = (judge(*drive(s), broken_s=1.0, end_s=2.0, profile=PROFILE) for s in (1.2, 1.9))
    row = summarize("x", ("watchdog",), [good, good, bad], good.zero_s + 1e-6)
    assert row["n"] == 3
    assert row["max_time_to_zero_s"] == max(good.zero_s, bad.zero_s)
    assert set(row) >= {"fault", "p50_s", "p99_s", "distance_m", "stale_obeyed", "moved_unasked"}


def test_what_has_to_be_counted_and_is_not_fails():
    quiet = judge(*drive(1.2), broken_s=1.0, end_s=2.0, profile=PROFILE)
    assert summarize("x", ("watchdog",), [quiet], 0.35)["passed"]
    assert not summarize("x", ("watchdog",), [replace(quiet, refused=1), quiet], 0.35, counted=True)["passed"]
    assert summarize("x", ("watchdog",), [replace(quiet, refused=1)], 0.35, counted=True)["passed"]


def test_a_journal_reads_back_up_to_a_torn_end(tmp_path):
    path = tmp_path / "journal.bin"
    writer = JournalWriter(path)
    writer.given(Given(1.0, 0.2, 0.0, 0.1, Reason.OK))
    writer.given(Given(1.1, 0.0, 0.0, 0.2))
    writer.truth(Truth(2.0, 1.0, 2.0, 0.2))
    writer.close()
    with path.open("ab") as file:
        file.write(b"torn")
    given = [Given(1.0, 0.2, 0.0, 0.1, Reason.OK), Given(1.1, 0.0, 0.0, 0.2)]
    assert read_journal(path, 0.0) == (given, [Truth(2.0, 1.0, 2.0, 0.2)])
    assert read_journal(path, 1.5)[0] == []


@pytest.fixture
def echo():
    """A relay before a TCP and UDP echo: the relay, and a socket of each kind that goes through it."""
    port, front = free_port(), free_port()
    tcp, udp = socket.create_server(("127.0.0.1", port)), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", port))

    def answer_stream():
        with tcp.accept()[0] as peer:
            while data := peer.recv(100):
                peer.sendall(data)

    def answer_datagrams():
        while True:
            data, address = udp.recvfrom(100)
            if data == b"end":
                return
            udp.sendto(data, address)

    threads = [threading.Thread(target=answer_stream), threading.Thread(target=answer_datagrams)]
    for thread in threads:
        thread.start()
    with Relay(front, port) as relay, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        with socket.create_connection(("127.0.0.1", front)) as stream:
            datagrams.connect(("127.0.0.1", front))
            for one in (stream, datagrams):
                one.settimeout(5.0)
                one.send(b"hello")
                assert one.recv(100) == b"hello"
            yield relay, stream, datagrams
        udp.sendto(b"end", ("127.0.0.1", port))
        for thread in threads:
            thread.join(5.0)
    tcp.close()
    udp.close()


def test_in_the_dark_datagrams_are_lost_and_streams_come_late(echo):
    relay, stream, datagrams = echo
    relay.faults.dark = True
    stream.send(b"late")
    datagrams.send(b"lost")
    stream.settimeout(0.3)
    with pytest.raises(TimeoutError):
        stream.recv(100)
    relay.faults.dark = False
    stream.settimeout(5.0)
    assert stream.recv(100) == b"late"
    datagrams.send(b"new")
    assert datagrams.recv(100) == b"new"


def test_it_delays_doubles_and_swaps(echo):
    relay, stream, datagrams = echo
    relay.faults.delay_s = 0.2
    began_s = time.monotonic()
    datagrams.send(b"slow")
    assert datagrams.recv(100) == b"slow"
    assert time.monotonic() - began_s > 0.35
    relay.faults.delay_s = 0.0
    relay.faults.copies = 2
    datagrams.send(b"x")
    assert [datagrams.recv(100) for _ in range(4)] == [b"x"] * 4
    relay.faults.copies = 1
    relay.faults.swap = True
    for one in (b"1", b"2", b"3", b"4"):
        datagrams.send(one)
    # Swapped on the way there, in pairs, and again on the way back.
    assert sorted(datagrams.recv(100) for _ in range(4)) == [b"1", b"2", b"3", b"4"]
    relay.cut()
    with contextlib.suppress(ConnectionResetError):
        assert stream.recv(100) == b""


def test_it_loses_what_does_not_get_through(echo):
    relay, stream, datagrams = echo
    relay.faults.lost = 1.0
    datagrams.send(b"lost")
    datagrams.settimeout(0.3)
    with pytest.raises(TimeoutError):
        datagrams.recv(100)
    relay.faults.lost = 0.0
    relay.faults.narrow_byte_s = 1000.0
    began_s = time.monotonic()
    for _ in range(20):
        datagrams.send(bytes(50))
    stream.send(bytes(100))
    stream.settimeout(5.0)
    assert stream.recv(100) == bytes(100)
    assert time.monotonic() - began_s > 0.2
    datagrams.settimeout(0.5)
    came = 0
    with contextlib.suppress(TimeoutError):
        while datagrams.recv(100):
            came += 1
    assert 2 <= came <= 6


def test_what_is_narrow_takes_one_after_the_other():
    narrows = Narrows()
    assert narrows.pass_s(100, 1000.0, 5.0) == pytest.approx(0.1)
    assert narrows.queue_s(5.05) == pytest.approx(0.05)
    assert narrows.pass_s(100, 1000.0, 5.05) == pytest.approx(0.15)
    assert narrows.queue_s(9.0) == 0.0
    assert narrows.pass_s(10**9, math.inf, 9.0) == 0.0


CI = (
    "hand's bridge killed (kill -9)",
    "black-out of 1 s",
    "link throttled to 1 kB/s",
    "second commander",
    "lidar freezes",
    "black image",
    "lira fusion frozen (SIGSTOP)",
    "disk full under labels and record",
    "link's process killed (kill -9)",
    "link's process frozen (SIGSTOP)",
    "robot's process frozen (SIGSTOP)",
    "base's driver hangs",
    "put without a certificate",
)


def try_in_short(names, folder):
    faults = [fault for fault in FAULTS if fault.name in names]
    assert len(faults) == len(names)
    rows = []
    run_matrix(faults, folder, "rosbot2", 1, 0, rows.append)
    assert [row["fault"] for row in rows] == [fault.name for fault in faults]
    for row in rows:
        assert row["passed"], json.dumps(row)
        assert 0.0 < row["distance_m"] < 0.5


def test_the_matrix_in_short(tmp_path):
    try_in_short(CI, tmp_path)


def test_clocks_that_are_set_change_nothing(tmp_path):
    if clock_library() is None:
        pytest.skip("needs libfaketime (Debian package libfaketime)")
    try_in_short(("robot's clock an hour behind", "driver's clock an hour ahead"), tmp_path)


def test_an_unknown_fault_is_said(capsys):
    assert main(["stop-test", "--only", "earthquake"]) == 2
    assert "no fault is called 'earthquake'" in capsys.readouterr().err


def test_fault_names_are_unique_and_those_of_a_stand_stay_together():
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    stands = [stand for stand, _ in groupby(fault.stand for fault in FAULTS)]
    assert len(stands) == len(set(stands))
