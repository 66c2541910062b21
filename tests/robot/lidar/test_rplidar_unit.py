"""Whatever a unit answers, the driver understands it or says in its own words that it does not."""

import contextlib
import struct

from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.errors import DeviceError
from lira.robot.rplidar.protocol import Answer, Info, parse_conf
from lira.robot.rplidar.unit import Unit
from lira.sim_backend.emulators.rplidar import descriptor

GONE = DeviceError("the line is gone", "")


class Script:
    """A line that says this, piece by piece, whatever it is told, and then is gone."""

    url, has_baud = "script", False

    def __init__(self, pieces):
        self._pieces = list(pieces)

    def write(self, data):
        """Nobody hears it."""

    def read(self, timeout_s):
        if not self._pieces:
            raise GONE
        return self._pieces.pop(0)


def answer(kind, body, stream):
    return descriptor(len(body), kind, stream=stream) + body


def conf(entry, value):
    return answer(0x20, struct.pack("<I", entry) + value, False)


KINDS = st.sampled_from([int(kind) for kind in Answer]) | st.integers(0, 255)
ANSWERS = st.builds(answer, KINDS, st.binary(max_size=40), st.booleans())
INFOS = st.binary(min_size=20, max_size=20).map(lambda body: answer(0x04, body, False))
CONFS = st.builds(conf, st.sampled_from([0x70, 0x71, 0x74, 0x75, 0x7C, 0x7F]), st.binary(max_size=40))
PIECES = st.lists(INFOS | CONFS | ANSWERS | st.binary(max_size=60), max_size=40)


@settings(max_examples=300, deadline=None)
@given(PIECES)
def test_no_answer_is_an_error_of_another_kind(pieces):
    unit = Unit(Script(pieces))
    info = Info(0x28, (1, 29), 5, "")
    for ask in (unit.identify, unit.check_health, lambda: unit.hears_motor(info), lambda: unit.start(info)):
        with contextlib.suppress(DeviceError):
            ask()


@given(st.binary(max_size=12), st.sampled_from([0x70, 0x7F]))
def test_an_entry_has_a_value_or_is_none(body, entry):
    value = parse_conf(body, entry)
    assert value is None or body.endswith(value)
