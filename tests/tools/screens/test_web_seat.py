"""Who drives from a page, who gets in, and what is shown: pure, with times made up."""

import math
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lira.hal.bus.security.keys import Keys
from lira.hal.bus.services import Info
from lira.hal.errors import ConfigError, DeviceError
from lira.hal.messages import (
    Applied,
    BatteryState,
    CourseState,
    Decision,
    ExpertView,
    LabelCounts,
    LaserScan,
    Odometry,
    Reason,
    Source,
    Twist,
)
from lira.hal.profile import load_profile
from lira.tools.joystick.axes import action_of
from lira.tools.joystick.deadman import Hand, State
from lira.tools.operator.situation import Situation, Urgency
from lira.tools.operator.view import View
from lira.tools.operator.voice import languages
from lira.tools.web import settings as page_settings
from lira.tools.web.access import LINK_S, Access, own_names, tls_context
from lira.tools.web.frame import BEAMS, frame_of
from lira.tools.web.seat import IDLE_S, OLDEST_S, SILENT_S, Control, Input, Seat, pad_of, page_mapping

STATIC = Path(page_settings.__file__).parent / "static"
ANNA, BEN = 1, 2


def said(seen, *held, forward=0.0, turn=0.0, away=False):
    return Input(seen, forward, turn, held, away)


def seated(now_s=10.0):
    seat = Seat()
    assert seat.take(ANNA, now_s)
    seat.hear(ANNA, said(now_s), now_s)
    return seat


def test_the_first_who_comes_sits_and_the_next_waits():
    seat = seated()
    assert not seat.take(BEN, 11.0)
    assert (seat.state(ANNA, 11.0), seat.state(BEN, 11.0)) == ("yours", "taken")
    seat.leave(BEN)
    assert seat.holder() == ANNA
    seat.leave(ANNA)
    assert seat.state(BEN, 11.0) == "free"
    assert seat.take(BEN, 11.0)


def test_a_seat_whose_holder_does_nothing_may_be_taken():
    seat = seated(10.0)
    seat.hear(ANNA, said(12.0, Control.DEAD_MAN), 12.0)
    assert not seat.take(BEN, 12.0 + IDLE_S - 0.1)
    assert seat.take(BEN, 12.0 + IDLE_S + 0.1)
    assert not seat.alive(12.0 + IDLE_S + 0.1)  # until the new page has spoken


@pytest.mark.parametrize(
    ("word", "lives"),
    [
        (said(10.0), True),
        (said(10.0 - 0.9 * OLDEST_S), True),
        (said(10.0 - 1.1 * OLDEST_S), False),
        (said(10.5), False),
        (said(math.nan), False),
        (said(10.0, away=True), False),
    ],
    ids=["fresh", "a little late", "late", "from the future", "no time", "away"],
)
def test_only_what_answers_a_new_frame_is_obeyed(word, lives):
    seat = seated(9.0)
    seat.take_said()
    seat.hear(ANNA, word, 10.0)
    assert seat.alive(10.0) is lives
    assert bool(seat.take_said()) is lives


def test_a_page_that_is_silent_is_gone():
    seat = seated(10.0)
    assert seat.alive(10.0 + 0.9 * SILENT_S)
    assert not seat.alive(10.0 + 1.1 * SILENT_S)


def test_a_gap_is_seen_also_by_who_looks_after_it():
    seat = seated(10.0)
    seat.take_break()
    for away in (said(10.05, away=True), said(10.05 - 2 * OLDEST_S)):
        seat.hear(ANNA, away, 10.05)
        seat.hear(ANNA, said(10.1), 10.1)
        assert seat.alive(10.1)
        assert seat.take_break()
        assert not seat.take_break()
    seat.hear(ANNA, said(10.1 + 2 * SILENT_S), 10.1 + 2 * SILENT_S)
    assert seat.take_break()


def test_nobody_hears_a_page_without_the_seat():
    seat = seated(10.0)
    seat.take_said()
    seat.hear(BEN, said(10.0, Control.DEAD_MAN, forward=1.0), 10.0)
    assert seat.take_said() == []


def test_the_budget_of_the_page_and_of_the_robot_is_the_law():
    """What was seen at most so long ago, then silence, then the robot's own time-out: 0.35 s and the time of a tick."""
    teleop_s = load_profile("thesis-sim").control.teleop_timeout_s
    assert max(OLDEST_S, SILENT_S) + teleop_s <= 0.35 + 1e-9


def test_a_page_is_a_pad():
    mapping = page_mapping()
    slow, fast = said(0.0, forward=1.0, turn=-1.0), said(0.0, Control.TURBO, forward=-1.0, turn=1.0)
    assert action_of(pad_of(slow, mapping), mapping) == pytest.approx((0.5, -0.5))
    assert action_of(pad_of(fast, mapping), mapping) == pytest.approx((-1.0, 1.0))
    for control in Control:
        assert len(pad_of(said(0.0, control), mapping).pressed) == 1


def test_a_page_that_comes_with_the_dead_man_held_does_not_drive():
    mapping = page_mapping()
    hand, held = Hand(mapping), pad_of(said(0.0, Control.DEAD_MAN, forward=1.0), mapping)
    assert hand.update(held, 0.0).action is None
    hand.update(pad_of(said(0.0), mapping), 0.1)
    assert hand.update(held, 0.2).action is not None
    assert hand.state is State.DRIVING


@pytest.mark.parametrize(
    "text",
    [
        '{"seen":0,"forward":2}',
        '{"seen":0,"forward":"x"}',
        '{"seen":0,"held":["jump"]}',
        '{"forward":0}',
        '{"seen":0,"more":1}',
        '{"seen":0,"turn":NaN}',
    ],
)
def test_what_no_page_says_is_refused(text):
    with pytest.raises(msgspec.MsgspecError):
        msgspec.json.decode(text, type=Input)


# Who gets in.


@pytest.mark.parametrize(
    ("host", "origin", "own"),
    [
        ("127.0.0.1:8080", None, True),
        ("localhost:8080", "http://localhost:8080", True),
        ("[::1]:8080", None, True),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "http://127.0.0.1:9999", False),
        ("127.0.0.1:8080", "null", False),
        ("evil.example:8080", None, False),
        ("evil.example:8080", "http://evil.example:8080", False),
        (None, None, False),
    ],
)
def test_only_this_servers_own_pages_reach_it(host, origin, own):
    access = Access(open_here=True, hosts=own_names("127.0.0.1"))
    assert access.is_own(host, origin) is own


def test_a_link_lets_one_browser_in_once_and_not_for_long():
    access = Access(open_here=False, hosts=frozenset({"10.0.0.2"}))
    assert not access.may_look(None)
    assert not access.may_look("")
    driver, viewer = access.new_link(0.0, drives=True), access.new_link(0.0, drives=False)
    session = access.enter(driver, 1.0)
    assert access.enter(driver, 1.0) is None
    assert (access.may_look(session), access.may_drive(session)) == (True, True)
    session = access.enter(viewer, 1.0)
    assert (access.may_look(session), access.may_drive(session)) == (True, False)
    assert access.enter(access.new_link(0.0, drives=True), LINK_S + 1.0) is None
    assert access.enter("guessed", 1.0) is None


def test_other_machines_get_in_only_with_keys(tmp_path):
    assert tls_context(None, "127.0.0.1") is None
    with pytest.raises(ConfigError, match="lira keys init"):
        tls_context(None, "0.0.0.0")
    with pytest.raises(ConfigError, match="keys"):
        tls_context(Keys(tmp_path, "laptop", None, ()), "0.0.0.0")


# What is shown.

EXPERTS = (ExpertView("camera", (1.0, 0.5), 0.16, True), ExpertView("lidar", (0.7, -0.6), 0.01, False))
DECISION = Decision(
    1.0, 3, "camera", "none", (0.8, 0.5), (0.1, 0.0), (0.2, 0.1), EXPERTS, 0.06, LabelCounts(1, 2, 3, 4, 5), 2, 3, 4
)
SCAN = LaserScan(1.0, -math.pi, math.radians(0.5), 0.1, 4.0, np.full(720, 2.0, np.float32))
VIEW = View(
    "rosbot",
    scan=SCAN,
    scan_age_s=0.1,
    odom=Odometry(1.0, 1.0, 2.0, 0.5, 0.3, 0.1),
    truth=CourseState(1.0, 5.0, 6.0, 0.7, 0.0, 0.0, 3.0, 0.1, 1.0),
    truth_age_s=0.1,
    applied=Applied(Twist(0.4, 0.2), 1.0, Source.POLICY, Reason.OK),
    link_age_s=0.02,
    decision=DECISION,
    decision_age_s=0.1,
    battery=BatteryState(1.0, 11.4),
)


def shown(view, **words):
    frame = frame_of(view, time_s=7.0, seat="free", language="en", **words)
    return msgspec.json.decode(msgspec.json.encode(frame))


def test_a_frame_has_all_that_is_known():
    frame = shown(VIEW)
    assert [actor["name"] for actor in frame["actors"]] == ["camera", "lidar", "novice", "human", "drives"]
    assert frame["pose"] == [5.0, 6.0, 0.7]
    assert frame["counts"]["human_labels"] == 3
    assert 0 < len(frame["scan"]) <= BEAMS
    assert max(abs(angle) for angle, _ in frame["scan"]) <= VIEW.fov_rad / 2
    assert (frame["situation"], frame["speed"]) == (Situation.EXPERT, [0.3, 0.1])


def test_what_is_old_is_not_shown_as_new():
    old = shown(replace(VIEW, scan_age_s=3.0, truth_age_s=3.0, decision_age_s=3.0, link_age_s=3.0))
    assert [old[name] for name in ("scan", "pose", "speed", "link_ms")] == [None] * 4
    assert (old["actors"], old["urgency"]) == ([], Urgency.ALARM)
    assert old["counts"]["human_labels"] == 3  # what was taught stays taught


def test_a_robot_that_waits_in_lockstep_is_not_lost():
    gone = replace(VIEW, link_age_s=3.0)
    frames = [shown(view) for view in (gone, replace(gone, lockstep=True), replace(VIEW, lockstep=True))]
    assert [(frame["link_ms"] is None, frame["waiting"]) for frame in frames] == [
        (True, False),
        (True, True),
        (False, False),
    ]
    assert frames[1]["who"] == "WAITS FOR A DRIVER"


def test_beams_that_say_nothing_are_left_out_and_none_is_far():
    ranges = np.array([math.nan, -math.inf, math.inf, 9.0, 0.5], np.float32)
    frame = shown(replace(VIEW, scan=LaserScan(1.0, -0.2, 0.1, 0.1, 4.0, ranges)))
    assert [distance for _, distance in frame["scan"]] == [4.0, 4.0, 0.5]


def test_a_frame_of_nothing_can_be_sent():
    assert shown(View("rosbot"))["situation"] == Situation.NO_LINK


# The page itself.


def test_the_page_has_words_for_everything_it_names_in_every_language():
    page = (STATIC / "index.html").read_text() + "".join(path.read_text() for path in STATIC.glob("*.js"))
    named = set(re.findall(r'data-(?:word|title|label)="(\w+)"', page)) | set(re.findall(r"\bwords\.(\w+)", page))
    for language in languages():
        assert named <= set(page_settings.labels(language)), language


def test_the_page_asks_nobody_else_and_is_small():
    sizes = 0
    for path in STATIC.iterdir():
        text = path.read_text()
        sizes += len(text)
        assert not re.search(r"(?:https?:)?//(?!www\.w3\.org/2000/svg)[a-z0-9-]+\.[a-z]{2,}", text), path.name
    assert sizes < 300_000


def test_a_page_is_told_the_robot_its_words_and_the_floor():
    info = Info(load_profile("thesis-sim"), "realtime", 0)
    told = page_settings.settings_of(info, "rosbot", 0, "en")
    assert told["floor"]["world"] is None
    assert set(told["shakes"]) < set(told["tones"]) <= set(Urgency)
    with pytest.raises(ConfigError):
        page_settings.labels("xx")


def test_the_page_that_left_its_seat_is_a_pad_that_is_gone():
    from lira.tools.web.pad import PageFinder

    seat, mapping = Seat(), page_mapping()
    finder = PageFinder(seat, mapping)
    assert finder() is None
    seat.take(ANNA, 0.0)
    assert finder() is None  # it has not spoken
    seat.leave(ANNA)
    from lira.tools.web.pad import PagePad

    pad = PagePad(seat, mapping, ANNA)
    with pytest.raises(DeviceError, match="left its seat"):
        pad.read()
    pad.close()
    pad.wake()  # a page may speak while its pad is closed
