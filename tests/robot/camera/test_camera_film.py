"""A video file as a camera: at its own speed, over again, in the profile's size."""

import time

import numpy as np
import pytest

from lira.hal.errors import DeviceError, SensorError
from lira.robot.camera.sources.opening import open_source

av = pytest.importorskip("av", reason="needs av: pip install 'lira-rosbot[video]'")
RATE_HZ, COUNT = 20, 8


@pytest.fixture
def film(tmp_path):
    """Eight pictures, each brighter than the one before."""
    path = tmp_path / "film.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=RATE_HZ)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for k in range(COUNT):
            pixels = np.full((48, 64, 3), 25 * k + 20, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode())
    return path


def shown(source, count):
    pictures = []
    while len(pictures) < count:
        if (picture := source.grab(0.5)) is not None:
            pictures.append(picture)
    return pictures


def test_a_film_is_shown_at_its_own_speed_and_over_again(film):
    source = open_source(str(film), (32, 24), None)
    began_s = time.monotonic()
    pictures = shown(source, COUNT + 2)
    assert time.monotonic() - began_s > 0.8 * COUNT / RATE_HZ
    assert all(picture.data.shape == (24, 32, 3) for picture in pictures)
    gray = [float(picture.data.mean()) for picture in pictures]
    assert max(gray) > 150
    assert min(gray[gray.index(max(gray)) + 1 :]) < 100  # from the start again
    source.close()


def test_who_looks_late_sees_the_newest(film):
    source = open_source(str(film), (64, 48), None)
    first = shown(source, 1)[0]
    time.sleep(0.6 * COUNT / RATE_HZ)
    assert float(shown(source, 1)[0].data.mean()) > float(first.data.mean()) + 50
    source.close()


def test_what_is_no_film_is_refused_by_name(tmp_path, film):
    (tmp_path / "text.mp4").write_text("no film")
    with pytest.raises(DeviceError, match=r"text.mp4 is no video"):
        open_source(str(tmp_path / "text.mp4"), (64, 48), None)
    source = open_source(str(film), (64, 64), None)
    with pytest.raises(SensorError):
        shown(source, 1)
    source.close()
