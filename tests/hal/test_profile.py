"""Profiles refuse what cannot be right, and name both values."""

import msgspec
import pytest

from lira.hal.config import parse_toml
from lira.hal.errors import ConfigError
from lira.hal.profile import NESTED, RobotProfile, known_profiles, load_profile


def toml(value):
    return repr(list(value) if isinstance(value, tuple) else value)


def load_with(table, **changes):
    data = msgspec.to_builtins(msgspec.structs.replace(load_profile("rosbot2"), ranger=()))
    data = {key: value for key, value in data.items() if value}
    data[table] |= changes
    text = "\n".join(
        [f"{key} = {value!r}" for key, value in data.items() if not isinstance(value, dict)]
        + [
            line
            for name, keys in data.items()
            if isinstance(keys, dict)
            for line in [f"[{name}]", *(f"{k} = {toml(v)}" for k, v in keys.items() if v is not None)]
        ]
    )
    return parse_toml(text, RobotProfile, "mine.toml")


def test_what_comes_with_the_project_nests():
    for name in known_profiles():
        control = load_profile(name).control
        times_s = [getattr(control, key) for key in NESTED]
        assert times_s == sorted(set(times_s))
    assert load_profile("rosbot2").field is not None
    assert load_profile("thesis-sim").field is None
    assert load_profile("thesis-sim").base.max_acceleration_m_s2 is None


@pytest.mark.parametrize(("key", "value", "words"), [
    ("pad_timeout_s", 0.2, "pad_timeout_s = 0.2 must be below control.teleop_timeout_s = 0.2"),
    ("teleop_timeout_s", 0.28, "teleop_timeout_s = 0.28 must be below control.policy_timeout_s = 0.25"),
    ("robot_timeout_s", 0.2, "policy_timeout_s = 0.25 must be below control.robot_timeout_s = 0.2"),
    ("firmware_timeout_s", 0.3, "robot_timeout_s = 0.3 must be below control.firmware_timeout_s = 0.3"),
    ("lease_s", 0.1, "policy_timeout_s = 0.25 must be below control.lease_s = 0.1"),
])  # fmt: skip
def test_time_outs_that_do_not_nest_are_an_error_that_names_both(key, value, words):
    with pytest.raises(ConfigError) as error:
        load_with("control", **{key: value})
    assert words in str(error.value)
    assert "mine.toml" in str(error.value)


def test_zones_nest_too():
    load_with("field", slow_m=0.2)
    with pytest.raises(ConfigError, match=r"field.stop_m = 0.3 must be below field.slow_m = 0.25"):
        load_with("field", stop_m=0.3)
