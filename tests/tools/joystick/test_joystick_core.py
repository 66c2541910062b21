import msgspec
import pytest

from lira.hal.config import parse_toml
from lira.hal.errors import ConfigError
from lira.hal.messages import JoyFeedback
from lira.tools.joystick.axes import AxisRange, PadState, action_of, shape
from lira.tools.joystick.freeze import GAPS, LONGEST_S, SHORTEST_S, FreezeWatch
from lira.tools.joystick.pad_wizard import learn
from lira.tools.joystick.pads.mapping import Mapping, known_pads, load_mapping
from lira.tools.joystick.rumble import ATTENTION, ATTENTION_ID, FEEDBACK, FEEDBACK_ID, Rumble, pattern_of

PS3 = load_mapping("ps3")


def test_the_ps3_pad_is_known_and_complete():
    assert "ps3" in known_pads()
    assert len(PS3.axes) == 6
    assert len(PS3.buttons) == 17
    assert (PS3.buttons[4], PS3.buttons[5], PS3.buttons[8], PS3.buttons[9], PS3.buttons[10]) == (
        "BTN_TL", "BTN_TR", "BTN_SELECT", "BTN_START", "BTN_MODE",
    )  # fmt: skip
    assert PS3.freeze


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ('turbo = "BTN_TL"', "different buttons"),
        ('turbo = "BTN_NOSUCH"', "no button named BTN_NOSUCH"),
        ('pause = "BTN_TL"', "different buttons"),
        ('experts = ["BTN_NOSUCH"]', "no button named BTN_NOSUCH"),
        ('turn = { axis = "ABS_NOSUCH" }', "no axis named ABS_NOSUCH"),
        ('turn = { axis = "ABS_Y" }', "different axes"),
        ("expo = 2.0", "expo"),
        ("dead_zone = 0.95", "dead_zone"),
        ("estop = []", "estop"),
        ("speed = 1.0", "unknown key"),
    ],
)
def test_a_wrong_mapping_is_refused_with_its_reason(line, complaint):
    key = line.split(" ")[0]
    good = {
        "name": 'name = "x"', "forward": 'forward = { axis = "ABS_Y" }', "turn": 'turn = { axis = "ABS_X" }',
        "dead_man": 'dead_man = "BTN_TL"', "turbo": 'turbo = "BTN_TR"', "estop": 'estop = ["BTN_MODE"]',
        "release": 'release = "BTN_START"',
    }  # fmt: skip
    assert parse_toml("\n".join(good.values()), Mapping, "good.toml").expo == 0.4
    with pytest.raises(ConfigError, match=complaint):
        parse_toml("\n".join((good | {key: line}).values()), Mapping, "bad.toml")


def test_an_unknown_pad_names_the_known_ones():
    with pytest.raises(ConfigError, match="ps3") as caught:
        load_mapping("xbox9000")
    assert "--learn" in caught.value.remedy


@pytest.mark.parametrize("expo", [0.0, 0.4, 1.0])
def test_the_dead_zone_is_cut_out_and_the_rest_reaches_the_ends_without_a_jump(expo):
    assert shape(0.12, 0.12, expo) == shape(-0.12, 0.12, expo) == 0.0
    assert shape(0.1201, 0.12, expo) == pytest.approx(0.0, abs=1e-3)
    assert shape(1.0, 0.12, expo) == pytest.approx(1.0)
    values = [shape(i / 100, 0.12, expo) for i in range(-100, 101)]
    assert values == sorted(values)
    assert values == [-value for value in reversed(values)]


def test_expo_is_finer_around_the_middle():
    assert shape(0.5, 0.0, 0.5) == pytest.approx(0.5 * 0.5 + 0.5 * 0.125)


def test_up_is_forward_left_is_left_and_turbo_is_full_speed():
    ranges = {0: AxisRange(0, 255), 1: AxisRange(0, 255)}
    assert action_of(PadState(ranges, {0: 128, 1: 0}), PS3) == pytest.approx((0.5, 0.0))
    assert action_of(PadState(ranges, {0: 0, 1: 128}), PS3) == pytest.approx((0.0, 0.5))
    assert action_of(PadState(ranges, {0: 255, 1: 255}, frozenset([311])), PS3) == pytest.approx((-1.0, -1.0))


def test_ranges_of_other_pads_and_axes_that_said_nothing():
    assert AxisRange(-32768, 32767).normalise(-32768) == -1.0
    assert AxisRange(0, 0).normalise(5) == 0.0
    assert AxisRange(0, 255).normalise(999) == 1.0
    assert action_of(PadState(), msgspec.structs.replace(PS3, cruise=1.0)) == (0.0, 0.0)


def chatter(watch, gap_s, n, start_s=0.0):
    for i in range(n):
        watch.note(start_s + i * gap_s)
    return start_s + (n - 1) * gap_s


@pytest.mark.parametrize(("gap_s", "timeout_s"), [(0.005, SHORTEST_S), (0.03, 0.15), (0.1, LONGEST_S)])
def test_the_time_out_is_learned_from_the_pad(gap_s, timeout_s):
    watch = FreezeWatch()
    last_s = chatter(watch, gap_s, GAPS + 1)
    assert watch.timeout_s == pytest.approx(timeout_s)
    assert watch.is_alive(last_s + timeout_s - 0.001)
    assert not watch.is_alive(last_s + timeout_s + 0.001)


def test_a_pad_has_to_prove_itself_at_first_and_after_a_freeze():
    watch = FreezeWatch()
    assert not watch.is_alive(0.0)
    last_s = chatter(watch, 0.01, GAPS)
    assert not watch.is_alive(last_s)
    watch.note(last_s + 0.01)
    assert watch.is_alive(last_s + 0.01)
    watch.note(last_s + 3.0)
    assert not watch.is_alive(last_s + 3.0)
    last_s = chatter(watch, 0.01, GAPS, last_s + 3.01)
    assert watch.is_alive(last_s)


def test_a_pad_that_is_mostly_silent_never_counts_as_alive():
    watch = FreezeWatch()
    last_s = chatter(watch, LONGEST_S + 0.1, 3 * GAPS)
    assert not watch.is_alive(last_s)


def test_calls_feel_different_and_end():
    assert ATTENTION != FEEDBACK
    for pattern in (ATTENTION, FEEDBACK):
        rumble = Rumble()
        assert rumble.strength(0.0) is None
        rumble.play(pattern, 10.0)
        felt = [rumble.strength(10.0 + i / 100) for i in range(300)]
        assert felt[0] == pattern[0][0]
        assert felt[-1] is None
        on = [i for i in range(1, 300) if felt[i] and not felt[i - 1]]
        assert len(on) + 1 == sum(strength > 0 for strength, _ in pattern)


def test_a_pattern_that_plays_goes_on_and_another_takes_its_place():
    rumble = Rumble()
    rumble.play(ATTENTION, 0.0)
    rumble.play(ATTENTION, 0.3)
    assert rumble.strength(0.35) is None
    rumble.play(ATTENTION, 1.0)
    rumble.play(FEEDBACK, 1.05)
    assert rumble.strength(1.3) == 1.0


def test_feedback_messages_become_patterns():
    kind = JoyFeedback.TYPE_RUMBLE
    assert pattern_of(JoyFeedback(kind, ATTENTION_ID, 1.0)) == ATTENTION
    assert pattern_of(JoyFeedback(kind, FEEDBACK_ID, 1.0)) == FEEDBACK
    assert pattern_of(JoyFeedback(kind, 0, 7.0))[0][0] == 1.0
    assert pattern_of(JoyFeedback(0, 0, 1.0)) == ()


@pytest.mark.parametrize("name", ["mine", "mine.json"])
def test_a_pads_file_that_no_bridge_would_know_by_its_name_is_refused_before_a_pad_is_looked_for(name, tmp_path):
    with pytest.raises(ConfigError, match=rf"is no \.toml file.*{name}\.toml"):
        learn(tmp_path / name, None)
