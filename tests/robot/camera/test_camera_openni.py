import shutil
import time

import numpy as np
import pytest
from camera_watch import DEBIAN, NO_OPENNI, Watch
from fresh import python

from lira.hal.errors import DeviceError
from lira.hal.messages import Image
from lira.robot.camera.sources.opening import open_source


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
        assert first.data.shape == (480, 640, 3)  # the profile's
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
        assert watch.pictures[-1].data.shape == (480, 640, 3)


def test_a_camera_that_is_lost_is_opened_again_with_its_depth(openni, monkeypatch):
    with Watch("openni:Dummy", openni, depth=True) as watch:
        watch.wait(3)
        wait = "lira.robot.camera.sources.astra.openni2.wait_for_any_stream"
        monkeypatch.setattr(wait, lambda *_: None)  # it says no more
        until_s = time.monotonic() + 3.0
        while watch.supervisor.alive:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert "sends no pictures" in str(watch.supervisor.failure)
        monkeypatch.undo()
        depths = len(watch.depths)
        watch.wait(len(watch.pictures) + 10)
        assert len(watch.depths) > depths


def test_without_a_camera_or_the_library_openni_says_what_to_do(openni):
    with pytest.raises(DeviceError, match="no camera opens through OpenNI2"):
        open_source("openni:nowhere", (640, 480), openni)


def test_without_the_library_openni_says_where_it_belongs(tmp_path, monkeypatch):
    for name in ("loaded_dll_directory", "_openni2_initialized"):  # another test may have loaded it
        monkeypatch.setattr(f"openni.openni2.{name}", None)
    with pytest.raises(DeviceError, match="does not load") as refused:
        open_source("openni:", (640, 480), tmp_path)
    assert "--openni" in refused.value.remedy


def test_openni_loads_from_the_right_folder_after_it_failed_in_a_wrong_one(openni, tmp_path):
    """In a process of its own: the library can only be loaded once."""
    broken = tmp_path / "broken"
    broken.mkdir()
    shutil.copy(openni / "libOpenNI2.so", broken)  # without its drivers it loads and does not start
    code = f"""
from pathlib import Path
from lira.hal.errors import DeviceError
from lira.robot.camera.sources.astra import load
for folder in (Path({str(broken)!r}), Path({str(tmp_path / "nothing")!r}), Path({str(broken)!r})):
    try:
        load(folder)
    except DeviceError as error:
        assert "already loaded" not in str(error), error
    else:
        raise SystemExit("it loaded without drivers")
load(Path({str(openni)!r}))
"""
    done = python(code)
    assert done.returncode == 0, done.stdout + done.stderr
