import contextlib
import math
import os
import signal
import sys
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info
from lira.hal.bus.topics import APPLIED, INFO, OPERATOR, OPERATOR_ANSWER
from lira.hal.client.connect import connect
from lira.hal.errors import ConfigError
from lira.hal.messages import (
    STOP,
    Applied,
    BatteryState,
    Command,
    CompressedImage,
    Decision,
    ExpertView,
    LabelCounts,
    LaserScan,
    OperatorAnswer,
    OperatorRequest,
    Reason,
    Request,
    Source,
    Twist,
)
from lira.tools.bench.parts.robots import null_robot_at_work, twin_at_work
from lira.tools.bench.takeover import policy
from lira.tools.cli import main
from lira.tools.console import sound
from lira.tools.console.keyboard import keyboard_mapping, pad_of
from lira.tools.console.picture import pixels_of
from lira.tools.joystick.axes import action_of
from lira.tools.joystick.client import TeleopClient
from lira.tools.launch.processes import ChildProcess, lira_command
from lira.tools.operator.listen import Ears
from lira.tools.operator.situation import CORNERS, URGENCY, Situation, Urgency
from lira.tools.operator.tones import TONES
from lira.tools.operator.view import View
from lira.tools.operator.voice import Voice, speak, verdict, vocabulary

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"

pygame = pytest.importorskip("pygame", reason="needs pygame: pip install 'lira-rosbot[console]'")
from lira.tools.console.canvas import Canvas, fitted  # noqa: E402
from lira.tools.console.draw import BANNER, COLOURS, SIZE, draw, draw_voice, fan  # noqa: E402
from lira.tools.console.palette import AMBER, GREEN, PANEL, RED, SKY  # noqa: E402
from lira.tools.console.screen import check_screen, window_size  # noqa: E402
from lira.tools.console.window import Keyboard  # noqa: E402

SCAN = LaserScan(1.0, -math.pi / 2, math.pi / 4, 0.1, 4.0, np.array([1.0, math.inf, 2.0, math.nan, 1.0], np.float32))
EXPERTS = (ExpertView("camera", (0.8, 0.5), 0.16, True), ExpertView("lidar", (0.7, -0.6), 0.01, False))
DECISION = Decision(
    1.0, 3, "camera", "attention", (0.8, 0.5), (0.1, 0.0), None, EXPERTS, 0.06, LabelCounts(1, 2, 3, 4, 5), 2, 3, 4
)
APPLIED_NOW = Applied(Twist(0.4, 0.2), 1.0, Source.POLICY, Reason.OK)
VIEW = View(
    "rosbot",
    scan=SCAN,
    scan_age_s=0.1,
    picture=CompressedImage(1.0, cv2.imencode(".png", np.full((32, 32, 3), 200, np.uint8))[1].tobytes()),
    picture_age_s=0.1,
    applied=APPLIED_NOW,
    link_age_s=0.02,
    decision=DECISION,
    decision_age_s=0.1,
    battery=BatteryState(1.0, 11.4),
)


def picture(view):
    pygame.font.init()
    surface = pygame.Surface(SIZE)
    draw(surface, view)
    return pygame.surfarray.array3d(surface)


def part(pixels, box):
    return pixels[box.x : box.right, box.y : box.bottom]


def share_of(pixels, colour):
    return float(np.mean(np.all(pixels == np.array(colour), axis=-1)))


def feedback(view):
    return replace(view, decision=replace(view.decision, call="feedback", driver="novice"))


STOPPED = replace(VIEW, estop=True)
LOUD = {"attention": (VIEW, AMBER), "feedback": (feedback(VIEW), SKY), "emergency stop": (STOPPED, RED)}


@pytest.mark.parametrize("name", LOUD)
def test_what_needs_a_person_fills_the_banner_with_its_colour(name):
    view, colour = LOUD[name]
    banner = part(picture(view), BANNER)
    assert share_of(banner, colour) > 0.6
    assert all(share_of(banner, other) == 0.0 for _, other in LOUD.values() if other != colour)


def test_letters_can_be_read_on_every_colour():
    for urgency, (colour, ink) in COLOURS.items():
        assert contrast(ink, colour if urgency in CORNERS else PANEL) >= 4.5


def contrast(first, second):
    """The ratio that WCAG 2 defines."""

    def luminance(colour):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in np.array(colour) / 255.0]
        return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    low, high = sorted((luminance(first), luminance(second)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("situation", Situation)
def test_all_words_fit_into_the_banner(situation):
    pygame.font.init()
    words = vocabulary("en")[situation]
    surface = pygame.Surface(SIZE)
    surface.fill((1, 2, 3))
    draw_voice(Canvas(surface), BANNER, Voice(situation, URGENCY[situation], words.who, words.why, words.now))
    pixels = pygame.surfarray.array3d(surface)
    pixels[BANNER.x : BANNER.right, BANNER.y : BANNER.bottom] = (1, 2, 3)
    assert share_of(pixels, (1, 2, 3)) == 1.0


def test_calls_are_told_apart_without_colour():
    gray = [part(picture(view), BANNER).mean(axis=-1) for view in (VIEW, STOPPED)]
    shape = [np.abs(g - np.median(g)) > 60 for g in gray]
    left = slice(20, 90)
    assert np.mean(shape[0][left] != shape[1][left]) > 0.05
    assert abs(np.median(gray[0]) - np.median(gray[1])) > 30


def test_a_call_that_is_over_or_old_leaves_no_banner():
    for view in (replace(VIEW, decision=replace(DECISION, call="none")), replace(VIEW, decision_age_s=2.0)):
        banner = part(picture(view), BANNER)
        assert share_of(banner, AMBER) == share_of(banner, RED) == 0.0


def test_only_what_changed_changes_on_the_screen():
    before = picture(VIEW)
    charged = picture(replace(VIEW, battery=BatteryState(1.0, 12.5)))
    changed = np.any(before != charged, axis=-1)
    assert changed[:, 628:].any()
    assert not changed[:, :620].any()
    nearer = picture(replace(VIEW, scan=replace(SCAN, ranges=np.full(5, 0.5, np.float32))))
    changed = np.any(before != nearer, axis=-1)
    assert changed[16:544, 358:618].any()
    assert not changed[545:].any()


def test_a_stale_picture_is_not_shown():
    box = pygame.Rect(16, 40, 528, 300)
    assert share_of(part(picture(VIEW), box), (200, 200, 200)) > 0.3
    assert share_of(part(picture(replace(VIEW, picture_age_s=2.0)), box), (200, 200, 200)) == 0.0


def test_actions_of_an_old_decision_are_not_shown_and_its_counts_are():
    bars, counts = pygame.Rect(690, 240, 560, 200), pygame.Rect(576, 488, 60, 40)
    fresh, old = picture(VIEW), picture(replace(VIEW, decision_age_s=2.0))
    assert share_of(part(fresh, bars), SKY) > 0.02
    assert share_of(part(old, bars), SKY) == 0.0
    assert np.array_equal(part(fresh, counts), part(old, counts))


def test_an_empty_view_can_be_drawn():
    picture(View("rosbot"))


def test_the_fan_has_left_on_the_left_and_drops_what_is_invalid():
    points = fan(SCAN, math.pi, 4.0, (100, 100), 80.0)
    assert points == [((80, 100), 0.25), ((100, 60), 0.5), ((157, 43), 1.0), ((120, 100), 0.25)]
    assert [share for _, share in fan(SCAN, 1.0, 4.0, (100, 100), 80.0)] == [0.5]


PAUSED = replace(
    VIEW, answer=OperatorAnswer(1.0, paused=True, count=2, words="paused"), answer_age_s=0.1, verdict_age_s=0.1
)


def test_an_answer_is_shown_with_its_verdict():
    refused = replace(PAUSED, answer=replace(PAUSED.answer, accepted=False))
    edge = pygame.Rect(560, 570, 9, 42)
    colours = [share_of(part(picture(view), edge), colour) for view, colour in ((PAUSED, GREEN), (refused, RED))]
    assert min(colours) > 0.9


def test_the_keyboard_is_a_pad():
    mapping = keyboard_mapping()
    assert action_of(pad_of({"up", "left"}), mapping) == pytest.approx((0.5, 0.5))
    assert action_of(pad_of({"down", "right", "left shift"}), mapping) == pytest.approx((-1.0, -1.0))
    assert action_of(pad_of({"up", "down", "left", "right"}), mapping) == (0.0, 0.0)
    assert pad_of({"space"}).holds(mapping.dead_man)
    assert pad_of({"escape"}).holds(mapping.estop[0])
    assert pad_of({"f1"}).holds(mapping.release)


def test_what_needs_a_person_sounds_different():
    heard = {urgency: np.frombuffer(sound.samples(tones), np.int16) for urgency, tones in TONES.items()}
    assert set(heard) == {Urgency.WATCH, Urgency.ASK, Urgency.NEED, Urgency.ALARM}
    assert len(heard[Urgency.ASK]) > 2 * len(heard[Urgency.WATCH])
    pitches = [np.argmax(np.abs(np.fft.rfft(s[:3000]))) * sound.RATE_HZ / 3000 for s in heard.values()]
    assert pitches == pytest.approx([880, 523, 262, 988], abs=15)


def test_a_truncated_picture_is_none():
    assert pixels_of(CompressedImage(0.0, b"\xff\xd8 no picture")) is None


SLOW = """
import sys, time
from lira.tools.cli import main
from lira.tools.console import window
draw = window.draw
window.draw = lambda *words: (time.sleep(0.3), draw(*words))
sys.exit(main(sys.argv[1:]))
"""


def drive_for(reader, duration_s=2.0):
    """What was applied meanwhile, and the times between two commands as the robot took them."""
    reader.poll()
    time.sleep(duration_s)
    results = [received.message for received in reader.poll()]
    first = {(r.session, r.seq): r.stamp_s - r.command_age_s for r in reversed(results)}
    return results, np.diff(sorted(first.values()))


def test_a_console_that_is_slow_stopped_or_killed_changes_nothing_in_control(tmp_path):
    with contextlib.ExitStack() as stack:
        name, endpoint, _ = stack.enter_context(null_robot_at_work())
        bus = Bus(name, connect=endpoint)
        stack.callback(bus.close)
        reader = bus.reader(APPLIED, depth=512)
        stack.enter_context(policy(name, endpoint))
        time.sleep(1.0)
        results, alone_s = drive_for(reader)
        words = ["--name", name, "--connect", endpoint]
        commands = {
            "quick": lira_command("console", *words),
            "slow": [sys.executable, "-c", SLOW, "console", *words],
        }
        consoles = {}
        for pace, command in commands.items():
            silent = ["env", "SDL_VIDEODRIVER=dummy", "SDL_AUDIODRIVER=dummy", *command]
            consoles[pace] = stack.enter_context(ChildProcess("the console", silent, tmp_path / f"{pace}.log"))
            consoles[pace].wait_ready("console shows", 30.0)
        gaps_s = {}
        more, gaps_s["slow"] = drive_for(reader)
        assert {console.status() for console in consoles.values()} == {None}
        results += more
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for console in consoles.values():
                console.signal(number)
            more, gaps_s[number.name] = drive_for(reader)
            results += more
    assert {r.source for r in results} == {Source.POLICY}
    assert {r.reason for r in results} == {Reason.OK}
    assert all(r.twist != STOP for r in results)
    for gaps in (alone_s, *gaps_s.values()):
        assert len(gaps) > 25
        assert np.median(gaps) == pytest.approx(np.median(alone_s), abs=0.01), gaps_s
        assert max(gaps) < 0.25


def test_the_keys_ask_and_say_that_nobody_answers():
    with contextlib.ExitStack() as stack:
        name, endpoint, _ = stack.enter_context(null_robot_at_work())
        bus, watch = Bus(name, connect=endpoint), Bus(name, connect=endpoint, watch=True)
        stack.callback(bus.close)
        stack.callback(watch.close)
        info = ask_info(bus)
        asked, answers = watch.reader(OPERATOR, depth=16), bus.publisher(OPERATOR_ANSWER)
        client, heard = TeleopClient(bus, watch, 10.0), []
        ears, keyboard = Ears(watch, info), Keyboard(client)
        listened = bus.publisher(OPERATOR)

        def press(keys, condition):
            deadline_s = time.monotonic() + 10.0
            while not condition():
                assert time.monotonic() < deadline_s, heard
                keyboard.update(frozenset(keys))
                heard.extend(received.message for received in asked.poll())
                time.sleep(1 / 30)

        def view():
            return replace(ears.look(), unanswered=keyboard.unanswered)

        press("", lambda: keyboard.state == "ready" and client.known and listened.matching)
        press("p", lambda: heard == [OperatorRequest(Request.PAUSE)])
        press("", lambda: keyboard.unanswered is Request.PAUSE)
        assert verdict(view()) == ("nobody answers to 'pause': does lira fusion run?", False)
        answers.put(OperatorAnswer(0.0, paused=True, count=1, words="paused"), 0.0)
        press("", lambda: verdict(view()) == ("paused", True))
        press("p", lambda: heard[1:] == [OperatorRequest(Request.RESUME)])
        press("r", lambda: heard[2:] == [OperatorRequest(Request.RESET)])


def looked_at(ears, situation):
    """Look until that is what is said; return the view."""
    deadline_s = time.monotonic() + 30.0
    while speak(view := ears.look()).situation != situation:
        assert time.monotonic() < deadline_s, view
        time.sleep(0.1)
    return view


def test_a_robot_in_lockstep_that_nobody_drives_waits_and_is_lost_only_when_it_is_gone():
    with contextlib.ExitStack() as stack:
        twin = contextlib.ExitStack()
        stack.enter_context(twin)
        name, endpoint, _ = twin.enter_context(twin_at_work("--lockstep", "--world", "line", "--renderer", "sketch"))
        watch = Bus(name, connect=endpoint, watch=True)
        stack.callback(watch.close)
        ears = Ears(watch, ask_info(watch))
        idle = looked_at(ears, Situation.LOCKSTEP)
        pictured = picture(idle)
        time.sleep(1.5)  # it repeats itself once a second: longer than a link may be silent elsewhere
        assert speak(ears.look()).situation is Situation.LOCKSTEP
        assert speak(ears.look()).who == "WAITS FOR A DRIVER"
        assert not np.array_equal(pictured, picture(replace(idle, lockstep=False)))
        with connect(endpoint, name) as robot:
            deadline_s = time.monotonic() + 30.0
            while not ears.look().linked:
                assert time.monotonic() < deadline_s
                robot.drive(Command(STOP, robot.now(), answers=robot.read().seq))
                robot.wait(robot.now() + robot.profile.period_s)
        looked_at(ears, Situation.LOCKSTEP)
        twin.close()
        looked_at(ears, Situation.NO_LINK)


def test_the_keyboard_drives_locks_without_the_focus_and_comes_back():
    with contextlib.ExitStack() as stack:
        name, endpoint, _ = stack.enter_context(null_robot_at_work())
        bus = Bus(name, connect=endpoint)
        stack.callback(bus.close)
        bus.ask(INFO)
        watch = Bus(name, connect=endpoint, watch=True)
        stack.callback(watch.close)
        keyboard, applied = Keyboard(TeleopClient(bus, watch, 10.0)), watch.reader(APPLIED)

        def press(keys, condition):
            deadline_s = time.monotonic() + 10.0
            while (newest := applied.newest()) is None or not condition(newest.message):
                assert time.monotonic() < deadline_s, (keyboard.state, newest)
                keyboard.update(keys)
                time.sleep(1 / 30)

        press(frozenset(), lambda _: keyboard.state == "ready")
        press(frozenset({"space"}), lambda a: a.source is Source.TELEOP)
        go = frozenset({"space", "up"})
        press(go, lambda a: a.twist.linear_m_s == pytest.approx(0.5))
        press(None, lambda a: a.twist == STOP and keyboard.state == "locked")
        press(go, lambda a: a.reason is Reason.STALE)
        assert keyboard.state == "locked"
        press(frozenset(), lambda _: keyboard.state == "ready")
        press(frozenset({"space"}), lambda a: a.source is Source.TELEOP)


def test_the_screenshot_is_made_without_a_screen_and_without_a_robot(tmp_path):
    path = tmp_path / "console.png"
    with ChildProcess("the console", lira_command("console", "--screenshot", str(path)), tmp_path / "log") as console:
        assert console.wait(60.0) == 0, console.output()
    assert pygame.image.load(str(path)).get_size() == SIZE


def test_a_screenshot_that_cannot_be_written_is_an_error_of_two_lines(tmp_path, capsys):
    assert main(["console", "--screenshot", str(tmp_path / "console.jpg")]) == 2
    assert "is no .png" in capsys.readouterr().err
    path = tmp_path / "nowhere" / "console.png"
    with ChildProcess("the console", lira_command("console", "--screenshot", str(path)), tmp_path / "log") as console:
        assert console.wait(60.0) == 2, console.output()
        assert console.output().splitlines()[0] == f"lira console: cannot write {path}"


@pytest.mark.parametrize(
    ("window", "box"),
    [
        ((1280, 680), (0, 0, 1280, 680)),
        ((800, 480), (0, 27, 800, 425)),
        ((1024, 600), (0, 28, 1024, 544)),
        ((3840, 2160), (0, 60, 3840, 2040)),
    ],
)
def test_the_console_is_whole_on_any_screen(window, box):
    assert tuple(fitted(SIZE, window)) == pytest.approx(box, abs=1)


def test_letters_and_lines_are_drawn_for_the_window_and_not_enlarged():
    """Twice as large, the edges of letters are as thin as before: enlarged pixels would make them twice as wide."""

    def blurred(size):
        pygame.font.init()
        surface = pygame.Surface(size)
        draw(surface, VIEW)
        gray = pygame.surfarray.array3d(surface).mean(axis=-1)
        edges = np.abs(np.diff(gray, axis=0)) > 10
        return np.mean(edges[:-1] & edges[1:]) / np.mean(edges)

    small, large = blurred(SIZE), blurred((2 * SIZE[0], 2 * SIZE[1]))
    assert large < small


def test_it_begins_no_larger_than_the_desktop():
    assert window_size(SIZE, (1366, 768)) == SIZE
    assert window_size(SIZE, (800, 480)) == (800, 425)


def test_nobody_looks_at_a_console_without_a_screen():
    check_screen("x11", None)
    check_screen("dummy", "dummy")
    with pytest.raises(ConfigError, match="lira web"):
        check_screen("offscreen", None)
