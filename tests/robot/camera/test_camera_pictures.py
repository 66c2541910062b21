import contextlib
import os
import struct

import cv2
import numpy as np
import pytest
from camera_watch import Watch
from hypothesis import given, settings
from hypothesis import strategies as st
from rude_cameras import jpeg

from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, Image
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES
from lira.robot.camera.fit import fit
from lira.robot.camera.header import read_header
from lira.robot.camera.sources.folder import load

SIZE = (640, 480)
LARGE_JPEG, SMALL_JPEG = jpeg(0, noise=1.0), jpeg(50)


def came(data):
    return fit(CompressedImage(1.0, data), SIZE)


def test_a_folder_is_shown_in_order_and_over_again(tmp_path):
    for i, gray in enumerate([10, 200]):
        (tmp_path / f"{i}.jpg").write_bytes(jpeg(gray))
    cv2.imwrite(str(tmp_path / "2.png"), np.full((48, 64, 3), (1, 2, 3), np.uint8))
    (tmp_path / "notes.txt").write_text("no image")
    with Watch(str(tmp_path)) as watch:
        watch.wait(4)
    first, second, third, again = watch.pictures[:4]
    assert first.data == again.data == jpeg(10)
    assert second.data == jpeg(200)
    assert third.data.shape == (480, 640, 3)
    assert third.data[0, 0].tolist() == [3, 2, 1]  # red first
    assert 0.03 < second.stamp_s - first.stamp_s < 0.5


def test_what_is_no_picture_in_a_folder_is_passed_over(tmp_path):
    (tmp_path / "a.jpg").write_bytes(jpeg(10))
    for name in ("b.png", "c.jpg"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "d.jpg").write_text("ten bytes.")
    (tmp_path / "e.png").mkdir()
    os.mkfifo(tmp_path / "f.png")
    (tmp_path / "g.png").symlink_to("/dev/zero")
    cv2.imwrite(str(tmp_path / "h.png"), np.full((3, 4, 4), 255, np.uint8))
    huge = bytearray((tmp_path / "h.png").read_bytes())
    huge[16:24] = (65500).to_bytes(4) * 2
    (tmp_path / "i.png").write_bytes(huge)
    (tmp_path / "j.jpg").write_bytes(LARGE_JPEG[:70_000])
    (tmp_path / "k.png").write_bytes(png(np.full((3, 4), 65535, np.uint16)))
    (tmp_path / "l.jpg").write_bytes(jpeg(9, (32, 32)))
    with Watch(str(tmp_path)) as watch:
        watch.wait(6)
        assert watch.supervisor.losses == 0
        assert watch.device.unreadable >= 6
    colours = [picture.data for picture in watch.pictures if isinstance(picture, Image)]
    assert (colours[0] == 255).all()


@settings(max_examples=100, deadline=None)
@given(data=st.data(), large=st.booleans())
def test_a_spoilt_picture_is_small_or_refused(data, large):
    spoilt = bytearray(LARGE_JPEG if large else SMALL_JPEG)
    for at in data.draw(st.lists(st.integers(0, min(len(spoilt), 700) - 1), min_size=1, max_size=6)):
        spoilt[at] = data.draw(st.sampled_from([0, 0xFF, 0xC0, 0xC2, 0xD8, 0xDA, 0x7F]))
    with contextlib.suppress(SensorError):
        seen = came(bytes(spoilt)).data
        assert len(seen) <= len(spoilt) if isinstance(seen, bytes) else seen.shape == (480, 640, 3)


def test_a_jpeg_of_the_profiles_size_goes_as_it_is():
    assert came(SMALL_JPEG) == CompressedImage(1.0, SMALL_JPEG)


def test_a_jpeg_too_large_to_travel_becomes_pixels():
    assert len(LARGE_JPEG) > PICTURE_LIMIT_BYTES
    assert came(LARGE_JPEG).data.shape == (480, 640, 3)


@pytest.mark.parametrize("size", [(1280, 960), (1440, 1080), (320, 240), (800, 608), (648, 486)])
def test_other_sizes_of_the_profiles_shape_leave_in_its_size(size):
    pixels = np.zeros((size[1], size[0], 3), np.uint8)
    pixels[: size[1] // 2, : size[0] // 4] = (250, 0, 0)  # blue first
    seen = came(cv2.imencode(".jpg", pixels)[1].tobytes())
    assert isinstance(seen, Image)
    assert seen.data.shape == (480, 640, 3)
    assert np.abs(seen.data[10:230, 10:150].astype(int) - (0, 0, 250)).max() < 12
    assert seen.data[250:].max() < 12


@pytest.mark.parametrize("size", [(1920, 1080), (352, 288), (480, 640), (32, 32)])
def test_another_shape_is_refused_by_name(size):
    for picture in (CompressedImage(1.0, jpeg(9, size)), Image(1.0, np.zeros((size[1], size[0], 3), np.uint8))):
        with pytest.raises(SensorError, match=f"{size[0]} x {size[1]}") as refused:
            fit(picture, SIZE)
        assert "profile" in refused.value.remedy


def exif(data, orientation, order="<"):
    entry = struct.pack(order + "HHIHH", 0x0112, 3, 1, orientation, 0)
    tiff = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "IH", 8, 1) + entry + bytes(4)
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(tiff) + 8) + b"Exif\0\0" + tiff + data[2:]


@pytest.mark.parametrize("order", "<>")
def test_a_picture_that_lies_on_its_side_is_put_upright(order):
    pixels = np.zeros((640, 480, 3), np.uint8)
    pixels[:320] = 250
    seen = came(exif(cv2.imencode(".jpg", pixels)[1].tobytes(), 6, order))  # its top is on the right
    assert seen.data.shape == (480, 640, 3)
    assert seen.data[:, 330:].min() > 230
    assert seen.data[:, :310].max() < 20
    upside_down = came(exif(jpeg(9), 3, order))
    assert isinstance(upside_down, Image)
    with pytest.raises(SensorError, match="another shape"):
        came(exif(jpeg(9), 6, order))
    assert came(exif(jpeg(9), 1, order)).data == exif(jpeg(9), 1, order)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=80))
def test_an_odd_exif_segment_is_no_error(segment):
    data = jpeg(9)
    head = b"\xff\xe1" + struct.pack(">H", len(segment) + 8) + b"Exif\0\0" + segment
    assert read_header(data[:2] + head + data[2:]).width == 640


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.95])
def test_half_a_jpeg_is_no_picture(keep):
    with pytest.raises(SensorError):
        came(jpeg(0, noise=1.0)[: round(keep * len(LARGE_JPEG))])
    with pytest.raises(SensorError):
        came(SMALL_JPEG[: round(keep * len(SMALL_JPEG))])


def test_a_jpeg_without_huffman_tables_is_not_passed_on_as_it_is():
    data = SMALL_JPEG
    while (at := data.find(b"\xff\xc4")) >= 0:
        data = data[:at] + data[at + 2 + int.from_bytes(data[at + 2 : at + 4]) :]
    assert not read_header(data).has_tables
    with contextlib.suppress(SensorError):  # a decoder may have the usual tables, or not
        assert isinstance(came(data), Image)


def png(pixels):
    return cv2.imencode(".png", pixels)[1].tobytes()


def test_pictures_of_16_bits_and_such_as_one_can_see_through_are_refused_by_name(tmp_path):
    opaque = np.full((48, 64, 4), 255, np.uint8)
    clear = opaque.copy()
    clear[3, 4, 3] = 254
    for name, data, complaint in [
        ("deep.png", png(np.full((48, 64), 65535, np.uint16)), "16 bits"),
        ("clear.png", png(clear), "alpha"),
    ]:
        (tmp_path / name).write_bytes(data)
        with pytest.raises(SensorError, match=complaint):
            load(tmp_path / name)
    (tmp_path / "opaque.png").write_bytes(png(opaque))
    assert load(tmp_path / "opaque.png").data.shape == (48, 64, 3)
