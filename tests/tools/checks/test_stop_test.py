"""The stop test: what it concludes from a journal, its relay, its mutants, and a few rows with real processes."""

import contextlib
import json
import math
import os
import socket
import threading
import time
from dataclasses import replace
from itertools import groupby

import pytest
from fresh import python

from lira.hal.messages import Reason, Twist
from lira.tools.cli import main
from lira.tools.launch.link_fault import Narrows, Relay
from lira.tools.launch.processes import free_port
from lira.tools.stop_test import matrix
from lira.tools.stop_test.cull import cull, judge_mutant, rows_of
from lira.tools.stop_test.journal import Heard, Journal, JournalReader, JournalWriter, Said, Sent, Truth, Wheels
from lira.tools.stop_test.matrix import Matrix, missing
from lira.tools.stop_test.mutants import MUTANTS, MutantError, break_product, swap
from lira.tools.stop_test.parts.sender import Pen
from lira.tools.stop_test.rows import ROWS
from lira.tools.stop_test.setups import clock_library
from lira.tools.stop_test.starved import longest_s, waits_s
from lira.tools.stop_test.verdict import Bounds, Rules, judge, summarize

pytestmark = pytest.mark.slow
STEP_S = 0.05
RULES = Rules(began_s=0.5, broken_s=1.0, mended_s=2.0, end_s=3.0)
BOUNDS = Bounds(budget_s=0.35, stoppers=frozenset({"watchdog"}))


class Story:
    """Writes a journal: one command every 50 ms, each marked, and the wheels that follow some of them."""

    def __init__(self):
        self.journal = Journal()
        self._mark = 0

    def send(self, time_s, *, who="driver", linear=0.2, heard=True):
        """Somebody commands; returns the mark."""
        self._mark += 1
        mark = self._mark * 1e-7 if linear else 0.0
        self.journal.sent.append(Sent(time_s, who, linear, mark))
        if heard:
            self.journal.heard.append(Heard(time_s + 0.001, linear, mark))
        return mark

    def follow(self, time_s, mark, *, linear=0.2, reason=Reason.OK):
        """The wheels are given something."""
        self.journal.wheels.append(Wheels(time_s, linear, mark))
        self.journal.said.append(Said(time_s, reason, linear != 0.0))
        self.journal.truth.append(Truth(time_s, 0.2 * time_s if linear else 0.0, 0.0, linear))

    def drive(self, from_s, until_s, *, late_s=0.01, **who):
        """Commands, each obeyed a moment later."""
        for step in range(round(from_s / STEP_S), round(until_s / STEP_S)):
            self.follow(step * STEP_S + late_s, self.send(step * STEP_S, **who))

    def stop(self, time_s, reason=Reason.STALE):
        """The wheels get zero."""
        self.follow(time_s, 0.0, linear=0.0, reason=reason)

    def ask(self, from_s, until_s, **who):
        """Commands that nobody obeys."""
        for step in range(round(from_s / STEP_S), round(until_s / STEP_S)):
            self.send(step * STEP_S, **who)


def sound():
    """The driver dies at 1.0 s, the robot stands 0.25 s later, is mended at 2.0 s, asked again, and stays."""
    story = Story()
    story.drive(0.0, 1.0)
    story.stop(1.2)
    story.ask(2.0, 2.5)
    return story


def verdict_of(story, **rules):
    return judge(story.journal, replace(RULES, **rules))


def passes(verdict, **bounds):
    return summarize("x", replace(BOUNDS, **bounds), [verdict])["passed"]


def test_time_counts_from_the_last_command_that_was_obeyed_by_its_senders_log():
    verdict = verdict_of(sound())
    assert verdict.zero_s == pytest.approx(1.2 - 0.95)
    assert verdict.fault_to_zero_s == pytest.approx(0.2)
    assert verdict.stopped_by == "watchdog"
    assert (verdict.stale_obeyed, verdict.moved_unasked, verdict.asked) == (0, False, 10)
    assert passes(verdict)


def test_a_command_that_is_obeyed_late_is_stale_whatever_the_robot_thinks_of_its_age():
    story = Story()
    marks = [story.send(step * STEP_S) for step in range(20)]
    for step, mark in enumerate(marks):
        story.follow(step * STEP_S + 0.3, mark)
    story.stop(1.4)
    story.ask(2.0, 2.5)
    verdict = verdict_of(story)
    assert verdict.stale_obeyed > 0
    assert not passes(verdict)


def test_repeating_an_old_command_does_not_make_it_younger():
    story = Story()
    story.drive(0.0, 1.0)
    for step in range(10):
        story.follow(1.0 + step * STEP_S, story.journal.sent[-1].angular_rad_s)
    story.stop(1.5)
    assert verdict_of(story).zero_s == pytest.approx(1.5 - 0.95)
    assert verdict_of(story).stale_obeyed > 0


@pytest.mark.parametrize("who", ["intruder", "liar", "joystick", "hand"])
def test_motion_by_anybody_else_is_unasked_even_before_the_stop(who):
    story = Story()
    story.drive(0.0, 0.9)
    story.follow(0.92, story.send(0.91, who=who))
    story.stop(1.2)
    story.ask(2.0, 2.5)
    assert verdict_of(story).moved_unasked
    assert not passes(verdict_of(story))


@pytest.mark.parametrize("motion", [Wheels(0.93, 0.2, 0.0), Wheels(0.93, 0.0, 2.0), Wheels(0.93, math.nan, 1e-7)])
def test_motion_that_nobody_sent_is_unasked(motion):
    story = sound()
    story.journal.wheels.insert(19, motion)
    assert verdict_of(story).moved_unasked


def test_a_command_cannot_be_obeyed_before_it_was_sent():
    story = sound()
    story.journal.wheels.append(Wheels(1.5, 0.2, story.journal.sent[-1].angular_rad_s))
    assert verdict_of(story).moved_unasked


def test_moving_again_is_unasked_however_often_it_is_asked_for():
    story = sound()
    story.drive(2.5, 2.6)
    assert verdict_of(story).moved_unasked
    assert verdict_of(story, resumes=True).moved_unasked  # nobody sent a neutral command


def test_who_may_resume_has_to_say_neutral_first_and_after_the_mending_if_it_has_to_be_new():
    def resumed(neutral_s, who="driver"):
        story = sound()
        story.send(neutral_s, who=who, linear=0.0)
        story.journal.sent.sort(key=lambda one: one.time_s)
        story.drive(2.5, 2.6)
        return story

    assert not verdict_of(resumed(1.5), resumes=True).moved_unasked
    assert verdict_of(resumed(1.5), resumes=True, renews=True).moved_unasked
    assert not verdict_of(resumed(2.2), resumes=True, renews=True).moved_unasked
    assert verdict_of(resumed(2.2, who="joystick"), resumes=True).moved_unasked
    assert verdict_of(resumed(2.2)).moved_unasked


def test_while_it_is_broken_nobody_may_resume():
    story = Story()
    story.drive(0.0, 1.0)
    story.stop(1.2)
    story.send(1.3, linear=0.0)
    story.drive(1.5, 1.6)
    assert verdict_of(story, resumes=True).moved_unasked


def test_before_the_silence_a_commander_may_stand_and_drive_on_but_only_by_its_own_neutral():
    def paused(reason, *, neutral):
        story = Story()
        story.drive(0.0, 1.1)
        story.send(1.1, linear=0.0 if neutral else 0.2)
        story.stop(1.11, reason)
        story.drive(1.15, 1.3)
        story.stop(1.5)
        story.ask(2.0, 2.5)
        return story

    own = paused(Reason.OK, neutral=True)
    assert passes(verdict_of(own, silent_s=1.3))
    assert verdict_of(own).moved_unasked
    assert verdict_of(paused(Reason.STALE, neutral=False), silent_s=1.3).moved_unasked
    assert verdict_of(own, silent_s=1.14).zero_s == math.inf  # it already stood


def test_a_robot_of_which_nobody_asked_to_move_again_has_shown_nothing():
    story = Story()
    story.drive(0.0, 1.0)
    story.stop(1.2)
    story.ask(1.3, 1.9)  # too early
    story.ask(2.0, 2.5, heard=False)  # it never arrived
    story.ask(2.0, 2.5, who="intruder")
    verdict = verdict_of(story)
    assert verdict.asked == 0
    assert not passes(verdict)
    assert verdict_of(sound(), asked_from_s=2.26).asked == 4


def test_of_those_who_are_shut_out_it_counts_what_they_send_and_nothing_may_be_obeyed():
    story = Story()
    story.drive(0.0, 1.0)
    story.stop(1.2)
    story.ask(2.0, 2.5, heard=False)
    assert passes(verdict_of(story, shut_out_s=1.1))
    assert not passes(verdict_of(story, shut_out_s=0.7))


def test_a_robot_that_never_stops_or_never_drove_fails():
    never = Story()
    never.drive(0.0, 3.0)
    assert verdict_of(never).zero_s == math.inf
    assert not passes(verdict_of(never))
    stood = Story()
    stood.drive(0.0, 0.8)
    stood.stop(0.9)
    stood.stop(1.1)
    stood.ask(2.0, 2.5)
    assert not passes(verdict_of(stood))


def test_a_fault_that_leaves_the_commands_valid_is_bounded_from_the_fault():
    story = Story()
    story.drive(0.0, 1.8)
    story.stop(1.81, reason=Reason.OBSTACLE)
    story.ask(2.0, 2.5)
    verdict = verdict_of(story)
    assert verdict.zero_s < 0.1
    assert passes(verdict, stoppers=frozenset({"protective field"}))
    assert not passes(verdict, stoppers=frozenset({"protective field"}), within_s=0.7)


@pytest.mark.parametrize(
    ("reason", "word"),
    [(Reason.STALE, "watchdog"), (Reason.OK, "zero commanded"), (Reason.ESTOP, "e-stop"), (None, "the guard")],
)
def test_what_stopped_it_is_what_the_governor_said_and_another_stop_than_expected_fails(reason, word):
    story = Story()
    story.drive(0.0, 1.0)
    if reason is None:
        story.journal.wheels.append(Wheels(1.2, 0.0, 0.0))
    else:
        story.stop(1.2, reason)
    story.ask(2.0, 2.5)
    verdict = verdict_of(story, below="the guard")
    assert verdict.stopped_by == word
    assert passes(verdict, stoppers=frozenset({word}))
    assert not passes(verdict, stoppers=frozenset({"something else"}))


def test_a_row_has_its_columns_and_the_worst_trial_decides():
    good = verdict_of(sound())
    for flaw in (
        {"zero_s": 0.36},
        {"stale_obeyed": 1},
        {"moved_unasked": True},
        {"stopped_by": "nothing"},
        {"asked": 2},
    ):
        row = summarize("x", BOUNDS, [good, replace(good, **flaw), good])
        assert not row["passed"], flaw
        assert row["n"] == 3
    assert set(row) >= {"fault", "p50_s", "p99_s", "max_time_to_zero_s", "budget_s", "distance_m", "refused", "asked"}


@pytest.mark.parametrize(("words", "tried"), [({}, 1), ({"stall_s": 0.1}, 3), ({"waited_s": 0.5}, 3)])
def test_a_trial_that_fails_is_repeated_only_where_the_machine_had_no_time(words, tried, monkeypatch):
    failed, trials = replace(verdict_of(sound()), zero_s=9.0, **words), []
    monkeypatch.setattr(matrix, "try_row", lambda *trial: trials.append(trial) or failed)
    assert matrix.try_fairly(None, ROWS[0], BOUNDS, 0.0) == failed
    assert len(trials) == tried


def test_who_is_ready_to_run_and_may_not_has_waited():
    before = waits_s([os.getpid(), 2**22 + 1])
    assert before
    assert all(wait_s >= 0.0 for wait_s in before.values())
    later = {thread: wait_s + 0.1 for thread, wait_s in before.items()} | {"new": 0.3}
    assert longest_s(before, later) == pytest.approx(0.3)
    assert longest_s(before, {}) == 0.0


def test_what_has_to_be_counted_and_is_not_fails():
    quiet = verdict_of(sound())
    loud = replace(quiet, refused=1)
    assert passes(quiet)
    assert not summarize("x", replace(BOUNDS, refusal=True), [loud, quiet])["passed"]
    assert passes(loud, refusal=True)


def test_a_journal_reads_back_in_order_up_to_a_torn_end(tmp_path):
    reader = JournalReader(tmp_path / "journal")
    writers = [JournalWriter(reader.folder, name) for name in ("robot", "driver")]
    records = [
        Sent(1.0, "hand", 0.2, 1e-4),
        Heard(1.1, 0.2, 1e-4),
        Wheels(1.2, 0.2, 1e-4),
        Said(1.3, Reason.ESTOP, moving=False),
        Truth(1.4, 1.0, 2.0, 0.2),
        Sent(1.5, "driver", 0.0, 0.0),
    ]
    writers[0].note(Truth(9.0, 0.0, 0.0, 0.0))
    reader.skip()
    for number, record in enumerate(reversed(records)):
        writers[number % 2].note(record)
    for writer in writers:
        writer.close()
    with (reader.folder / "lira.robot.bin").open("ab") as file:
        file.write(b"torn")
    journal = reader.read()
    assert journal.sent == [records[0], records[5]]
    assert [journal.heard, journal.wheels, journal.said, journal.truth] == [[one] for one in records[1:5]]


def test_a_mark_tells_one_command_from_the_other_and_moves_nothing(tmp_path):
    reader = JournalReader(tmp_path / "journal")
    pens = [Pen(reader.folder, who) for who in ("driver", "intruder")]
    twists = [pen.mark(Twist(0.2, angular)) for _ in range(50) for pen in pens for angular in (0.0, 1.0, -1.0)]
    assert len({one.angular_rad_s for one in reader.read().sent}) == len(twists)
    assert all(min(abs(twist.angular_rad_s - to) for to in (0.0, 1.0, -1.0)) < 1e-3 for twist in twists)
    assert all(abs(twist.angular_rad_s) <= 1.0 for twist in twists)
    assert pens[0].mark(Twist(0.0, 0.0)) == Twist(0.0, 0.0)
    for pen in pens:
        pen.close()


def test_rows_have_names_of_their_own_and_those_of_a_setup_stay_together():
    assert len({row.name for row in ROWS}) == len(ROWS) >= 55
    setups = [setup for setup, _ in groupby(row.setup for row in ROWS)]
    assert len(setups) == len(set(setups))
    assert all(row.budget_s <= 0.7 or row.below == "base board" for row in ROWS)


def test_mutants_have_names_of_their_own_and_rows_that_there_are():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS) >= 16
    assert {row.name for row in rows_of(MUTANTS)} == {name for mutant in MUTANTS for name in mutant.rows}


def test_a_mutant_is_caught_by_rows_that_fail_because_of_it_and_by_nothing_else():
    mutant = replace(MUTANTS[0], rows=("a", "b"))
    sound_rows = {"a": "", "b": ""}
    assert judge_mutant(mutant, sound_rows, {"a": "failed", "b": "failed"})["caught"]
    assert not judge_mutant(mutant, sound_rows, {"a": "failed", "b": ""})["caught"]
    assert not judge_mutant(mutant, sound_rows, {"a": "failed", "b": "the robot did not get going"})["caught"]
    assert not judge_mutant(mutant, {"a": "", "b": "failed"}, {"a": "failed", "b": "failed"})["caught"]


def test_every_mutant_finds_what_it_breaks():
    apply = "from lira.tools.stop_test.mutants import *\nfor one in MUTANTS: break_product(one.name)"
    done = python(apply)
    assert done.returncode == 0, done.stderr


def test_a_mutant_that_no_longer_applies_is_an_error():
    with pytest.raises(MutantError, match="has no 'gone'"):
        swap(Story, "gone", None)
    with pytest.raises(MutantError, match="no mutant"):
        break_product("unheard of")


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


def test_who_sits_in_the_link_can_send_again_what_went_to_the_robot(echo):
    relay, _, datagrams = echo
    sender = threading.Timer(0.1, lambda: [datagrams.send(one) for one in (b"1", b"2")])
    sender.start()
    recorded = relay.record(0.4)
    sender.join()
    datagrams.send(b"3")  # nobody records any more
    assert [datagrams.recv(100) for _ in range(3)] == [b"1", b"2", b"3"]
    assert [one.data for one in recorded] == [b"1", b"2"]
    for one in recorded:
        relay.replay(one)
    assert [datagrams.recv(100) for _ in range(2)] == [b"1", b"2"]


def test_what_is_narrow_takes_one_after_the_other():
    narrows = Narrows()
    assert narrows.pass_s(100, 1000.0, 5.0) == pytest.approx(0.1)
    assert narrows.queue_s(5.05) == pytest.approx(0.05)
    assert narrows.pass_s(100, 1000.0, 5.05) == pytest.approx(0.15)
    assert narrows.queue_s(9.0) == 0.0
    assert narrows.pass_s(10**9, math.inf, 9.0) == 0.0


# Of each setup what no other test of the suite breaks; `lira stop-test` tries them all.
IN_SHORT = {
    "twin": ("hand's bridge killed (kill -9)", "second commander", "lidar freezes"),
    "link": ("link's process frozen (SIGSTOP)",),
    "drivers": ("robot's governor hangs", "board hears no more"),
    "keys": ("put without a certificate",),
    "clocks": ("robot's clock an hour behind",),
}


@pytest.mark.parametrize("setup", IN_SHORT)
def test_the_matrix_in_short(setup, tmp_path):
    if setup == "clocks" and clock_library() is None:
        pytest.skip("needs libfaketime (Debian package libfaketime)")
    rows = [row for row in ROWS if row.name in IN_SHORT[setup]]
    assert len({row.setup for row in rows}) == 1
    results = Matrix(tmp_path, "rosbot2", 0).run(rows, 1, lambda _: None)
    assert {result["fault"] for result in results} == set(IN_SHORT[setup])
    for result in results:
        assert result["passed"], json.dumps(result)
        assert 0.0 < result["distance_m"] < 0.7


def test_a_mutant_is_caught_by_a_row_that_passes_without_it(tmp_path):
    mutants = [mutant for mutant in MUTANTS if mutant.name == "releasing the emergency stop arms"]
    (result,) = cull(mutants, tmp_path, "rosbot2", 0, lambda _: None, lambda _: None)
    assert result["caught"], json.dumps(result)


def test_where_everything_is_installed_every_row_can_be_tried():
    assert clock_library() is None or not any(missing(row) for row in ROWS)


def test_an_unknown_row_or_mutant_is_said(capsys):
    assert main(["stop-test", "--only", "earthquake"]) == 2
    assert "no row is called 'earthquake'" in capsys.readouterr().err
    assert main(["stop-test", "--mutants", "--only", "earthquake"]) == 2
    assert "no mutant is called 'earthquake'" in capsys.readouterr().err
