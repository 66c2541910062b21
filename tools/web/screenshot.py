"""A picture of the page with a sample drive, as an installed browser draws it: for the README, and to look at."""

import asyncio
import shutil
import subprocess
import tempfile
import threading
from dataclasses import replace
from pathlib import Path

import msgspec

from lira.hal.bus.services import Info
from lira.hal.errors import ConfigError, StorageError
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.tools.console.sample import sample_view
from lira.tools.web.access import Access, own_names
from lira.tools.web.seat import Seat
from lira.tools.web.server import PageServer, serve_page
from lira.tools.web.settings import settings_of

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1366, 768)
LOAD_MS, END_S = 4000, 60.0
HOST = "127.0.0.1"


def save_page(path: Path, size: tuple[int, int] = SIZE) -> None:
    """Draw the page and write it as .png. Raises `ConfigError` without a browser, `StorageError` if nothing came."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise ConfigError("no browser is installed to draw the page with", f"Install one of: {', '.join(BROWSERS)}.")
    view, world = sample_view(), load_world("line-obstacles")
    picture = view.picture
    assert picture is not None
    info = Info(load_profile("thesis-sim"), "realtime", 0, arena=msgspec.Raw(msgspec.json.encode(world)))
    settings = lambda language, layout: settings_of(info, view.robot, 0, language, layout)  # noqa: E731
    access = Access(open_here=True, hosts=own_names(HOST))
    server = PageServer(lambda: replace(view, picture=replace(picture)), Seat(), access, None, settings)
    stop, up, ports = threading.Event(), threading.Event(), list[int]()

    def ready(port: int) -> None:
        ports.append(port)
        up.set()

    thread = threading.Thread(target=lambda: asyncio.run(serve_page(server, HOST, 0, None, ready, stop)), daemon=True)
    thread.start()
    up.wait(END_S)
    try:
        with tempfile.TemporaryDirectory() as home:
            flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={home}"]
            flags += [f"--window-size={size[0]},{size[1]}", f"--virtual-time-budget={LOAD_MS}"]
            words = [browser, *flags, f"--screenshot={path.resolve()}", f"http://{HOST}:{ports[0]}/"]
            done = subprocess.run(words, capture_output=True, text=True, timeout=END_S, check=False)
    finally:
        stop.set()
        thread.join(END_S)
    if done.returncode or not path.is_file():
        raise StorageError(f"the browser wrote no {path}", "Name a .png file in a folder that may be written.")
