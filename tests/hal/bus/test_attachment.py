"""The attachment survives the wire; what others attach is not mistaken for ours."""

import random

import pytest

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.errors import CodecError


@pytest.mark.parametrize(
    "attachment",
    [Attachment(0, 0, 0), Attachment(2**64 - 1, 2**63 - 1, -(2**62), 2**63 - 1, True), Attachment(1, 2, 3, 4, False)],
)
def test_round_trip(attachment):
    assert parse_attachment(attachment.to_bytes()) == attachment


@pytest.mark.parametrize(
    "beyond",
    [
        Attachment(1, 2**63, 0),
        Attachment(1, 2**64 - 1, 0),
        Attachment(1, 1, 2**62),
        Attachment(1, 1, -(2**63)),
        Attachment(1, 1, 0, -2),
    ],
)
def test_a_number_that_no_message_holds_makes_it_none_of_ours_and_none_of_a_ros_peer(beyond):
    with pytest.raises(CodecError):
        parse_attachment(beyond.to_bytes())


def test_foreign_attachments_are_none():
    good = Attachment(1, 2, 3).to_bytes()
    rng = random.Random(5)
    foreign = [None, b"", b"LIR1", good[:-1], good + b"\0", b"LIR2" + good[4:], bytes(33), bytes(len(good))]
    foreign += [rng.randbytes(rng.randrange(80)) for _ in range(200)]
    assert [parse_attachment(data) for data in foreign] == [None] * len(foreign)
