import contextlib
import os
import socket
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.errors import ConfigError, DeviceError, SensorError
from lira.hal.messages import CompressedImage, DepthImage, Image
from lira.hal.messages.compression import PICTURE_LIMIT_BYTES
from lira.hal.profile import load_profile
from lira.robot.camera.device import CameraDevice, shrink
from lira.robot.camera.mjpeg import parse_parts
from lira.robot.camera.source import open_source
from lira.robot.camera.video import VideoSource
from lira.robot.supervisor import Supervisor
from lira.sim_backend.emulators.camera import MjpegServer

CAMERA = load_profile("rosbot2").camera
DEBIAN = sorted(Path("/usr/lib").glob("*/libOpenNI2.so.0"))
NO_OPENNI = "libopenni2-0 is not installed"


def jpeg(gray, size=(64, 48), noise=0.0):
    pixels = np.full((size[1], size[0], 3), gray, np.uint8)
    if noise:
        pixels = np.random.default_rng(0).integers(0, 255, pixels.shape).astype(np.uint8)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


LARGE_JPEG, SMALL_JPEG = jpeg(0, (640, 480), noise=1.0), jpeg(50)


class Watch:
    """A camera device on a source."""

    def __init__(self, url, openni=None, depth=False):
        self.pictures, self.depths = [], []
        self.device = CameraDevice(url, CAMERA, self.put, openni, depth=depth)
        self.supervisor = Supervisor("camera", self.device.session)

    def __enter__(self):
        self.supervisor.start()
        return self

    def __exit__(self, *_):
        self.supervisor.close()

    def put(self, picture):
        (self.depths if isinstance(picture, DepthImage) else self.pictures).append(picture)

    def wait(self, count, timeout_s=6.0):
        until_s = time.monotonic() + timeout_s
        while len(self.pictures) < count:
            assert time.monotonic() < until_s, self.supervisor.failure
            time.sleep(0.01)
        return self.pictures[-1]


def test_a_folder_is_shown_in_order_and_over_again(tmp_path):
    for i, gray in enumerate([10, 200]):
        (tmp_path / f"{i}.jpg").write_bytes(jpeg(gray))
    cv2.imwrite(str(tmp_path / "2.png"), np.full((4, 5, 3), (1, 2, 3), np.uint8))
    (tmp_path / "notes.txt").write_text("no image")
    with Watch(str(tmp_path)) as watch:
        watch.wait(4)
    first, second, third, again = watch.pictures[:4]
    assert first.data == again.data == jpeg(10)
    assert second.data == jpeg(200)
    assert third.data[0, 0].tolist() == [3, 2, 1]  # red first
    assert 0.03 < second.stamp_s - first.stamp_s < 0.5


def test_an_mjpeg_stream_passes_pictures_on_as_they_are():
    server = MjpegServer()
    server.show(jpeg(50))
    with Watch(server.url) as watch:
        assert watch.wait(1) == CompressedImage(watch.pictures[0].stamp_s, jpeg(50))
        shown_s = time.monotonic()
        server.show(jpeg(60))
        seen = watch.wait(2)
        assert seen.data == jpeg(60)
        assert 0.0 <= seen.stamp_s - shown_s < 0.2
    server.close()


def test_a_stream_that_ends_is_lost_and_comes_back():
    server = MjpegServer()
    server.show(jpeg(50))
    with Watch(server.url) as watch:
        watch.wait(1)
        server.close()
        until_s = time.monotonic() + 3.0
        while watch.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert watch.supervisor.failure.remedy
        again = MjpegServer(server.port)
        again.show(jpeg(70))
        assert watch.wait(2).data == jpeg(70)
        again.close()


PARTS = b"".join(b"--x\r\nContent-Type: image/jpeg\r\n%s\r\n%s\r\n" % (b"Content-Length: %d\r\n" % 40, body)
                 for body in (b"--x\r\n\r\n" + b"a" * 33, b"b" * 40))  # fmt: skip
LENGTHLESS = b"".join(b"--x\r\nContent-Type: image/jpeg\r\n\r\n%s\r\n" % body for body in (b"a" * 40, b"b" * 40))


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(0, len(PARTS)), stream=st.sampled_from([PARTS, LENGTHLESS + b"--x\r\n"]))
def test_parts_are_found_however_they_are_cut(cut, stream):
    first, rest = parse_parts(stream[:cut], b"x")
    second, _ = parse_parts(rest + stream[cut:], b"x")
    bodies = first + second
    assert [body[-1:] for body in bodies] == [b"a", b"b"]
    assert all(len(body) == 40 for body in bodies)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300))
def test_noise_in_a_stream_is_no_error(data):
    parse_parts(data, b"x")


def test_a_picture_too_large_to_travel_is_encoded_again():
    large = jpeg(0, (640, 480), noise=1.0)
    assert len(large) > PICTURE_LIMIT_BYTES
    small = shrink(CompressedImage(1.0, large))
    assert len(small.data) <= PICTURE_LIMIT_BYTES
    assert cv2.imdecode(np.frombuffer(small.data, np.uint8), cv2.IMREAD_COLOR).shape == (480, 640, 3)
    assert shrink(CompressedImage(1.0, jpeg(5))).data == jpeg(5)


def test_what_is_no_camera_is_said_with_the_remedy(tmp_path):
    for url, error, what in [
        ("bluetooth:x", ConfigError, "is no camera"),
        (str(tmp_path), DeviceError, "holds no image"),
        ("http://127.0.0.1:1/", DeviceError, "no camera answers"),
        ("/dev/video99", DeviceError, "no camera opens"),
    ]:
        with pytest.raises(error, match=what) as refused:
            open_source(url, (640, 480), None)
        assert refused.value.remedy


def claiming(data, width=65500, height=65500):
    """A JPEG whose frame header says that it is larger."""
    at = data.index(b"\xff\xc0")
    return data[: at + 5] + height.to_bytes(2) + width.to_bytes(2) + data[at + 9 :]


@pytest.mark.parametrize("size", [(16, 12), (640, 480)])
def test_a_picture_that_claims_too_much_is_lost_and_the_next_one_shown(size):
    server = MjpegServer()
    server.show(jpeg(50))
    with Watch(server.url) as watch:
        watch.wait(1)
        server.show(claiming(jpeg(0, size, noise=1.0)))
        until_s = time.monotonic() + 3.0
        while not watch.device.unreadable:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        server.show(jpeg(60))
        assert watch.wait(2).data == jpeg(60)
        assert watch.supervisor.losses == 0
    server.close()


def test_a_camera_whose_pictures_cannot_be_read_is_lost_and_says_why(monkeypatch):
    monkeypatch.setattr("lira.robot.camera.device.FIRST_S", 0.5)
    server = MjpegServer()
    server.show(b"<html>no picture</html>")
    with Watch(server.url) as watch:
        until_s = time.monotonic() + 4.0
        while watch.supervisor.failure is None:
            server.show(b"<html>no picture</html>")
            assert time.monotonic() < until_s
            time.sleep(0.02)
        assert "no pictures that can be read: a picture of 23 bytes was refused" in str(watch.supervisor.failure)
        assert not watch.pictures
    server.close()


def test_what_is_no_picture_in_a_folder_is_passed_over(tmp_path):
    (tmp_path / "a.jpg").write_bytes(jpeg(10))
    for name in ("b.png", "c.jpg"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "d.jpg").write_text("ten bytes.")
    (tmp_path / "e.png").mkdir()
    os.mkfifo(tmp_path / "f.png")
    (tmp_path / "g.png").symlink_to("/dev/zero")
    cv2.imwrite(str(tmp_path / "h.png"), np.full((3, 4, 4), 65535, np.uint16))
    png = bytearray((tmp_path / "h.png").read_bytes())
    png[16:24] = (65500).to_bytes(4) * 2
    (tmp_path / "i.png").write_bytes(png)
    (tmp_path / "j.jpg").write_bytes(jpeg(200, (640, 480), noise=1.0)[:70_000])
    with Watch(str(tmp_path)) as watch:
        watch.wait(6)
        assert watch.supervisor.losses == 0
        assert watch.device.unreadable >= 4
    colours = [picture.data for picture in watch.pictures if isinstance(picture, Image)]
    assert colours[0].tolist() == [[[255] * 3] * 4] * 3


@contextlib.contextmanager
def raw_stream(*pieces):
    """An MJPEG server that sends these bytes, with a pause after each; yields its URL and who has asked."""
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(0.05)
    stop, asked = threading.Event(), []

    def serve():
        while not stop.is_set():
            with contextlib.suppress(OSError):
                connection, _ = listener.accept()
                asked.append(connection)
                connection.settimeout(5.0)
                connection.recv(4096)
                connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=x\r\n\r\n")
                for piece in pieces:
                    connection.sendall(piece)
                    stop.wait(0.1)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/", asked
    finally:
        stop.set()
        thread.join()
        for connection in asked:
            connection.close()
        listener.close()


def part(body, head=b""):
    head = head or b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(body)
    return b"--x\r\n" + head + body + b"\r\n"


@pytest.mark.parametrize(
    "odd",
    [
        part(b"", b"X: " + b"y" * 20_000),
        part(b"", b"Content-Length: 99999999999\r\n\r\n"),
        part(b"", b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n"),
        part(b"z" * 600_000, b"X: y\r\n\r\n"),
        b"--x" * 10_000,
        b"\0" * 300_000,
    ],
    ids=["endless head", "long", "longest", "endless body", "boundaries", "noise"],
)
def test_an_odd_part_of_a_stream_is_passed_over(odd, monkeypatch):
    monkeypatch.setattr("lira.robot.camera.mjpeg.LARGEST_BYTES", 500_000)
    with raw_stream(part(jpeg(1)), odd, part(jpeg(2)) * 2) as (url, asked), Watch(url) as watch:
        assert watch.wait(2).data == jpeg(2)
        assert len(asked) == 1


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.sampled_from([b"--x", b"\r\n", b"\r\n\r\n", b"Content-Length: ", b"7", b"-1", b"a" * 9000]), max_size=60
    )
)
def test_what_is_left_of_a_stream_is_bounded_and_nothing_is_found_twice(pieces):
    data = b"".join(pieces)
    bodies, rest = parse_parts(data, b"x")
    assert len(rest) <= len(data)
    assert sum(map(len, bodies)) + len(rest) <= len(data)
    again, _ = parse_parts(rest, b"x")
    assert again == []


ODD = st.binary(max_size=300) | st.builds(part, st.binary(max_size=300)) | st.just(claiming(LARGE_JPEG)).map(part)


@settings(max_examples=6, deadline=None)
@given(st.lists(ODD, max_size=4).map(b"".join))
def test_whatever_a_camera_sends_it_shows_the_next_picture(odd):
    with raw_stream(odd, part(jpeg(2)) * 2) as (url, _), Watch(url) as watch:
        assert watch.wait(1, 10.0).data == jpeg(2)


@settings(max_examples=100, deadline=None)
@given(data=st.data(), large=st.booleans())
def test_a_spoilt_picture_is_small_or_refused(data, large):
    spoilt = bytearray(LARGE_JPEG if large else SMALL_JPEG)
    for at in data.draw(st.lists(st.integers(0, min(len(spoilt), 700) - 1), min_size=1, max_size=6)):
        spoilt[at] = data.draw(st.sampled_from([0, 0xFF, 0xC0, 0xC2, 0xD8, 0xDA, 0x7F]))
    with contextlib.suppress(SensorError):
        assert len(shrink(CompressedImage(1.0, bytes(spoilt))).data) <= len(spoilt)


def test_a_page_that_is_no_stream_is_refused():
    from http.server import BaseHTTPRequestHandler, HTTPServer
    from threading import Thread

    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(404)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Page)
    thread = Thread(target=server.handle_request)
    thread.start()
    with pytest.raises(DeviceError, match="no MJPEG stream"):
        open_source(f"http://127.0.0.1:{server.server_address[1]}/", (640, 480), None)
    thread.join()
    server.server_close()


@pytest.fixture
def openni(tmp_path):
    """Debian's OpenNI2 under the name that the Python package looks for."""
    if not DEBIAN:
        pytest.skip(NO_OPENNI)
    (tmp_path / "libOpenNI2.so").symlink_to(DEBIAN[0])
    (tmp_path / "OpenNI2").symlink_to(DEBIAN[0].parent / "OpenNI2")
    return tmp_path


def test_openni_takes_pictures_and_can_be_opened_again(openni):
    for _ in range(2):
        with Watch("openni:Dummy", openni) as watch:
            watch.wait(5)
        first, *_, last = watch.pictures
        assert isinstance(first, Image)
        assert first.data.shape == (240, 320, 3)
        assert first.data.dtype == np.uint8
        assert not np.array_equal(first.data, last.data)  # its ball moves
        periods_s = np.diff([picture.stamp_s for picture in watch.pictures])
        assert 0.01 < np.median(periods_s) < 0.1


def test_openni_gives_depth_beside_the_pictures_and_it_can_be_opened_again(openni):
    for _ in range(2):
        with Watch("openni:Dummy", openni, depth=True) as watch:
            watch.wait(30)
        assert 3 <= len(watch.depths) <= 20  # ten a second: it travels at five
        depth = watch.depths[-1]
        assert depth.data.shape == (240, 320)
        assert depth.data.dtype == np.uint16
        assert 0 < depth.data.max() <= 10_000  # millimetres
        assert watch.pictures[-1].data.shape == (240, 320, 3)


def test_a_camera_that_is_lost_is_opened_again_with_its_depth(openni, monkeypatch):
    with Watch("openni:Dummy", openni, depth=True) as watch:
        watch.wait(3)
        monkeypatch.setattr("lira.robot.camera.astra.openni2.wait_for_any_stream", lambda *_: None)  # it says no more
        until_s = time.monotonic() + 3.0
        while watch.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert "sends no pictures" in str(watch.supervisor.failure)
        monkeypatch.undo()
        depths = len(watch.depths)
        watch.wait(len(watch.pictures) + 10)
        assert len(watch.depths) > depths


def test_depth_of_a_camera_that_has_none_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="has no depth"):
        open_source(str(tmp_path), (640, 480), None, depth=True)


@pytest.fixture
def film(tmp_path):
    """A file that OpenCV reads as it reads a UVC camera: 20 pictures, red at first and then blue."""
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (64, 48))
    for i in range(20):
        writer.write(np.full((48, 64, 3), (0, 0, 200) if i < 10 else (200, 0, 0), np.uint8))
    writer.release()
    return path


def test_video_is_read_picture_by_picture_red_first_and_its_end_is_a_loss_that_is_mended(film, monkeypatch):
    opened = []

    def open_film(*_, **__):
        opened.append(VideoSource(str(film), (64, 48)))
        return opened[-1]

    monkeypatch.setattr("lira.robot.camera.device.open_source", open_film)
    with Watch("/dev/video0") as watch:
        watch.wait(25)
    assert len(opened) >= 2
    first, last = watch.pictures[0], watch.pictures[19]
    assert first.data.shape == (48, 64, 3)
    assert np.abs(first.data.reshape(-1, 3).mean(axis=0) - [200, 0, 0]).max() < 12
    assert np.abs(last.data.reshape(-1, 3).mean(axis=0) - [0, 0, 200]).max() < 12


def test_without_a_camera_or_the_library_openni_says_what_to_do(openni):
    with pytest.raises(DeviceError, match="no camera opens through OpenNI2"):
        open_source("openni:nowhere", (640, 480), openni)


def test_without_the_library_openni_says_where_it_belongs(tmp_path, monkeypatch):
    for name in ("loaded_dll_directory", "_openni2_initialized"):  # another test may have loaded it
        monkeypatch.setattr(f"openni.openni2.{name}", None)
    with pytest.raises(DeviceError, match="does not load") as refused:
        open_source("openni:", (640, 480), tmp_path)
    assert "--openni" in refused.value.remedy
