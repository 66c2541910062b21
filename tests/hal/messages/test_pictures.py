"""A picture is looked over before a decoder sets aside what it claims."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from lira.hal.messages.images import MOST_SCANS, PNG_START, objection, size_of


def png(width, height, bits, kind):
    """All black."""
    each = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[kind] * bits // 8

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    pixels = zlib.compress(bytes((1 + width * each) * height))
    return PNG_START + chunk(b"IHDR", head) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def jpeg(width, height, *options):
    return cv2.imencode(".jpg", np.zeros((height, width, 3), np.uint8), list(options))[1].tobytes()


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        (png, (1920, 1080, 8, 2)),
        (png, (640, 480, 16, 0)),
        (png, (1, 1, 8, 6)),
        (jpeg, (1920, 1080)),
        (jpeg, (16, 12, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
        (jpeg, (33, 17, cv2.IMWRITE_JPEG_RST_INTERVAL, 1)),
    ],
)
def test_what_cameras_send_is_decoded(kind, numbers):
    data = kind(*numbers)
    assert objection(data) == ""
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) is not None


@pytest.mark.parametrize(
    ("kind", "numbers"), [(png, (8192, 8192, 8, 0)), (png, (2048, 1024, 16, 6)), (jpeg, (4000, 3000))]
)
def test_pixels_count_not_bytes(kind, numbers):
    data = kind(*numbers)
    assert len(data) < 300_000
    assert "pixels" in objection(data)


def test_a_jpeg_that_claims_more_behind_something_else_is_found_out():
    small = jpeg(16, 12)
    at = small.index(b"\xff\xc0")
    large = small[: at + 5] + struct.pack(">HH", 65000, 65000) + small[at + 9 :]
    comment = b"\xff\xfe" + struct.pack(">H", 40) + b"\xff\xda" * 19
    for front in (b"", comment, b"garbage", b"\xff\xff\xff"):
        assert "pixels" in objection(large[:2] + front + large[2:])


def test_a_jpeg_of_ever_more_scans_is_none():
    data = jpeg(16, 12, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    scan = data[data.rindex(b"\xff\xda") : -2]
    assert objection(data[:-2] + scan * 3 + data[-2:]) == ""
    assert objection(data[:-2] + scan * MOST_SCANS + data[-2:]) == "too many scans"


@pytest.mark.parametrize("data", [b"", b"BM" + bytes(60), b"RIFF....WEBP", PNG_START, PNG_START + bytes(30)])
def test_other_formats_and_beginnings_are_none(data):
    assert objection(data)


@pytest.mark.parametrize("between", [b"", b"junk", b"\xff\xff", b"\x00\xff\x00"])
def test_a_size_is_read_where_the_decoder_reads_it(between):
    head, tables, rest = jpeg(33, 17).partition(b"\xff\xdb")
    picture = head + between + tables + rest
    decoded = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert objection(picture) == ""
    assert size_of(picture) == (33, 17) == decoded.shape[1::-1]
