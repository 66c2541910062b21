"""A page without a browser: a client at the socket of `lira web` that says what a page says, and when it says it."""

import asyncio
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

from lira.hal.errors import BusError
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

SAY_S = 0.04  # a page says what its controls are 25 times a second, and at once when they change
READY_S = 30.0


class PageThumb:
    """Holds and lets go, from any thread."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._pressed = False
        self._loop = asyncio.new_event_loop()
        self._changed = asyncio.Event()
        self._seated = threading.Event()
        self._stop = False
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=[self._live()], name="page")
        self._thread.start()

    def press(self) -> None:
        """Thumbs on the dead-man, and on the stick."""
        self._become(pressed=True)

    def let_go(self) -> None:
        """Thumbs off."""
        self._become(pressed=False)

    def wait_seated(self) -> None:
        """Wait until the page has the controls. Raises `BusError`."""
        if not self._seated.wait(READY_S):
            raise BusError("the page did not get the controls", "Is the machine overloaded?")

    def close(self) -> None:
        """Close the page."""
        self._stop = True
        self._loop.call_soon_threadsafe(self._changed.set)
        self._thread.join()
        self._loop.close()

    def _become(self, *, pressed: bool) -> None:
        self._pressed = pressed
        self._loop.call_soon_threadsafe(self._changed.set)

    async def _live(self) -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{self._url}/socket") as socket:
            await socket.send_json({"type": "take", "sit": True})
            seen: list[float] = [0.0]
            looking = asyncio.create_task(self._look(socket, seen))
            while not self._stop:
                if seen[0]:
                    held = {"forward": 1.0, "held": ["dead_man"]} if self._pressed else {}
                    await socket.send_json({"type": "say", "input": {"seen": seen[0], **held}})
                try:
                    await asyncio.wait_for(self._changed.wait(), SAY_S)
                except TimeoutError:
                    continue
                self._changed.clear()
            looking.cancel()

    async def _look(self, socket: "aiohttp.ClientWebSocketResponse", seen: list[float]) -> None:
        """Take in frames: each word answers the newest."""
        async for message in socket:
            if message.type is aiohttp.WSMsgType.TEXT:
                frame: dict[str, Any] = json.loads(message.data)
                seen[0] = frame["time"]
                if frame["seat"] == "yours":
                    self._seated.set()


@contextmanager
def page_of(name: str, endpoint: str, folder: Path) -> Iterator[PageThumb]:
    """`lira web` for a robot, and one page of it that has the controls."""
    port = free_port()
    words = ["web", "--name", name, "--connect", endpoint, "--port", str(port)]
    with ChildProcess("lira web", lira_command(*words), folder / "lira.web.log") as web:
        web.wait_ready("web shows", READY_S)
        thumb = PageThumb(f"http://127.0.0.1:{port}")
        try:
            thumb.wait_seated()
            yield thumb
        finally:
            thumb.close()
