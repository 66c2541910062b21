import sys
import time

import pytest
from camera_watch import Watch
from rude_cameras import claiming, jpeg

from lira.hal.errors import ConfigError, DeviceError, MissingExtraError
from lira.hal.messages import CompressedImage
from lira.robot.camera.sources.opening import open_source
from lira.sim_backend.emulators.camera import MjpegServer


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
        assert "no pictures that can be used: a picture of 23 bytes was refused" in str(watch.supervisor.failure)
        assert not watch.pictures
    server.close()


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


def test_depth_of_a_camera_that_has_none_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="has no depth"):
        open_source(str(tmp_path), (640, 480), None, depth=True)


def test_without_the_library_a_video_camera_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.delitem(sys.modules, "lira.robot.camera.sources.video", raising=False)
    with pytest.raises(MissingExtraError) as told:
        open_source("rtsp://127.0.0.1:1/", (640, 480), None)
    assert "lira-rosbot[video]" in told.value.remedy
