"""Whoever writes a file is told what does not fit, and what would, in words."""

import pytest

from lira.hal.config import parse_toml
from lira.hal.errors import ConfigError
from lira.hal.misfit import COMPARE
from lira.sim_backend.world import World

WHOLE = 'name = "mine"\ndescription = "a line"\n[limits]\nlost_m = 1.0\n'


@pytest.mark.parametrize(
    ("text", "what", "remedy"),
    [
        (f"{WHOLE}[line]\npeices = []", "unknown key `peices` - at `line`", "Did you mean `pieces`?"),
        (f"{WHOLE}[[box]]\nx_m = 1\nqq = 2", "unknown key `qq` - at `box[0]`", "Known here: x_m, y_m, "),
        (f"{WHOLE}[[box]]\nx_m = 1\ny_mm = 2", "unknown key `y_mm` - at `box[0]`", "Did you mean `y_m`?"),
        (f"limit = 3\n{WHOLE}", "unknown key `limit`", "Did you mean `limits`?"),
        (f"{WHOLE}finish_m = 'x'", "Expected a number, got text - at `limits.finish_m`", "Write a number there."),
        (f"box = 3\n{WHOLE}", "Expected a list, got a whole number - at `box`", "Write a list there."),
        ("name = 'mine'", "`description` is missing", COMPARE),
    ],
)
def test_what_does_not_fit_is_said_with_what_would(text, what, remedy):
    with pytest.raises(ConfigError) as told:
        parse_toml(text, World, "mine.toml")
    assert told.value.what == f"mine.toml: {what}"
    assert told.value.remedy.startswith(remedy)
