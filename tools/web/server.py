"""Serves the page: files, one socket for each browser, pictures as they come. One thread, and nothing in it drives.

What a page says goes to the seat (`seat.py`), which the bridge's own thread looks at. A browser that is slow, or says
nonsense, costs itself what it does not read, or its socket; nobody else waits for it.
"""

import asyncio
import contextlib
import itertools
import ssl
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event
from typing import Annotated, Any, Protocol

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web
from msgspec import Meta

from lira.hal.errors import ConfigError
from lira.tools.operator.view import STALE_S, View
from lira.tools.operator.voice import ENGLISH, languages
from lira.tools.web.access import COOKIE, Access
from lira.tools.web.frame import frame_of
from lira.tools.web.seat import Client, Input, Seat

STATIC = Path(__file__).parent / "static"
FRAMES_HZ = 30.0  # a page that drives answers each of them: they are its heartbeat
MOST_CLIENTS = 16
LONGEST_BYTES = 2048
LONGEST_LAYOUT = 9  # digits
MOST_SAID_HZ = 200.0
LOOK_S = 0.1
SEND_S = 5.0  # a browser that takes nothing for so long is gone
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' blob:; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class Say(msgspec.Struct, frozen=True, tag="say"):
    """The controls of a page that drives."""

    input: Input


class Take(msgspec.Struct, frozen=True, tag="take"):
    """The page wants the seat, or leaves it."""

    sit: bool


class Stop(msgspec.Struct, frozen=True, tag="stop"):
    """The emergency stop is pressed; anybody may."""


class Speak(msgspec.Struct, frozen=True, tag="speak"):
    """The page wants another language."""

    language: Annotated[str, Meta(max_length=16)]


Said = Say | Take | Stop | Speak
_DECODER = msgspec.json.Decoder(Said)


@dataclass(slots=True)
class Browser:
    """One socket. `pace` counts what it says."""

    number: Client
    socket: web.WebSocketResponse
    drives: bool
    language: str = ENGLISH
    pace: "Pace" = field(default_factory=lambda: Pace(MOST_SAID_HZ))


class Pace:
    """Whether somebody says more than so much a second. Pure."""

    def __init__(self, most_hz: float) -> None:
        self._most_hz = most_hz
        self._left, self._last_s = most_hz, float("-inf")

    def allows(self, now_s: float) -> bool:
        """Count one more."""
        gained = min(self._most_hz, (now_s - self._last_s) * self._most_hz)
        self._left, self._last_s = min(self._most_hz, self._left + gained) - 1.0, now_s
        return self._left >= 0.0


class Hand(Protocol):
    """The controls behind the page; `tools.web.controls.Controls` are the real ones."""

    @property
    def confirmed(self) -> bool:
        """Whether the robot has said that the emergency stop holds which was pressed here."""

    def state(self) -> str:
        """How the dead-man is."""

    def wake(self) -> None:
        """A page has spoken, or has gone."""

    def press_stop(self) -> None:
        """Press the emergency stop."""


class PageServer:
    """The page for one robot. `look` gives what is known now; without a `hand` nobody drives, and nobody stops."""

    def __init__(
        self,
        look: Callable[[], View],
        seat: Seat,
        access: Access,
        hand: Hand | None,
        settings: Callable[[str, int | None], dict[str, Any]],
        say: Callable[[str], None] = print,
    ) -> None:
        self._look, self._seat, self._access, self._hand = look, seat, access, hand
        self._settings, self._say = settings, say
        self._numbers = itertools.count(1)
        self._browsers: dict[Client, Browser] = {}
        self._view: View | None = None
        self._ticks = asyncio.Condition()

    def application(self) -> web.Application:
        """What to serve."""
        application = web.Application(middlewares=[self._guard], client_max_size=LONGEST_BYTES)
        application.router.add_get("/", self._page)
        application.router.add_get("/enter/{link}", self._enter)
        application.router.add_get("/settings.json", self._tell_settings)
        application.router.add_get("/socket", self._talk)
        application.router.add_static("/static", STATIC)
        application.cleanup_ctx.append(self._ticking)
        return application

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Nobody gets anything who names another host, comes from another page, or has not come in by a link."""
        if not self._access.is_own(request.headers.get("Host"), request.headers.get("Origin")):
            raise web.HTTPForbidden(text="This page is reached by the address that lira web prints.")
        if not request.path.startswith("/enter/") and not self._access.may_look(request.cookies.get(COOKIE)):
            raise web.HTTPForbidden(text="Open the link that lira web shows; each lets one browser in, once.")
        response = await handler(request)
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    async def _page(self, request: web.Request) -> web.StreamResponse:  # noqa: ARG002 - aiohttp's signature
        return web.FileResponse(STATIC / "index.html")

    async def _enter(self, request: web.Request) -> web.StreamResponse:
        session = self._access.enter(request.match_info["link"], time.monotonic())
        if session is None:
            raise web.HTTPForbidden(text="This link was used or is too old: press Enter at lira web for a new one.")
        response = web.HTTPFound("/")
        response.set_cookie(COOKIE, session, httponly=True, secure=request.secure, samesite="Strict")
        raise response

    async def _tell_settings(self, request: web.Request) -> web.StreamResponse:
        language = request.query.get("language", ENGLISH)
        layout = request.query.get("layout", "")
        known = layout.isdecimal() and len(layout) <= LONGEST_LAYOUT
        return web.json_response(
            self._settings(language if language in languages() else ENGLISH, int(layout) if known else None)
        )

    async def _talk(self, request: web.Request) -> web.StreamResponse:
        """One browser, until it goes."""
        if len(self._browsers) >= MOST_CLIENTS:
            raise web.HTTPServiceUnavailable(text=f"{MOST_CLIENTS} pages are open already.")
        socket = web.WebSocketResponse(max_msg_size=LONGEST_BYTES, heartbeat=10.0, compress=False)
        await socket.prepare(request)
        drives = self._hand is not None and self._access.may_drive(request.cookies.get(COOKIE))
        browser = Browser(next(self._numbers), socket, drives)
        self._browsers[browser.number] = browser
        showing = asyncio.create_task(self._show(browser))
        try:
            await self._listen(browser)
        finally:
            self._leave(browser)
            del self._browsers[browser.number]
            showing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await showing
        return socket

    async def _listen(self, browser: Browser) -> None:
        """Take in what a browser says; who says nonsense, or too much, is not listened to any more."""
        async for message in browser.socket:
            try:
                if message.type is not WSMsgType.TEXT or not browser.pace.allows(time.monotonic()):
                    raise msgspec.ValidationError("too much, or no text")
                self._take(browser, _DECODER.decode(message.data))
            except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
                await browser.socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"not understood")
                return

    def _take(self, browser: Browser, said: Said) -> None:
        now_s = time.monotonic()
        match said:
            case Stop():
                if self._hand is not None:
                    self._say(f"emergency stop, pressed on page {browser.number}")
                    self._hand.press_stop()
            case Take(sit=False):
                self._leave(browser)
            case Take() if browser.drives and self._seat.take(browser.number, now_s):
                self._say(f"page {browser.number} has the controls")
            case Say() if browser.drives:
                self._seat.hear(browser.number, said.input, now_s)
                if self._hand is not None:
                    self._hand.wake()
            case Speak():
                browser.language = said.language if said.language in languages() else ENGLISH

    def _leave(self, browser: Browser) -> None:
        self._seat.leave(browser.number)
        if self._hand is not None:
            self._hand.wake()

    async def _ticking(self, _: web.Application) -> Any:
        """Look at the robot, at an even pace, for all browsers at once."""

        async def tick() -> None:
            due_s = time.monotonic()
            while True:
                self._view = self._look()
                async with self._ticks:
                    self._ticks.notify_all()
                due_s = max(due_s + 1.0 / FRAMES_HZ, time.monotonic())
                await asyncio.sleep(due_s - time.monotonic())

        task = asyncio.create_task(tick())
        yield
        task.cancel()
        for browser in list(self._browsers.values()):
            await browser.socket.close(code=WSCloseCode.GOING_AWAY)

    async def _show(self, browser: Browser) -> None:
        """Send one browser the newest; what it has no time for is never sent."""
        shown = None
        while not browser.socket.closed:
            async with self._ticks:
                await self._ticks.wait()
            view = self._view
            if view is None:
                continue
            now_s = time.monotonic()
            seat = self._seat.state(browser.number, now_s) if browser.drives else "viewer"
            frame = frame_of(self._seen_by(seat, view), time_s=now_s, seat=seat, language=browser.language)
            try:
                async with asyncio.timeout(SEND_S):
                    await browser.socket.send_str(msgspec.json.encode(frame).decode())
                    if view.picture is not None and view.picture is not shown and view.picture_age_s <= STALE_S:
                        await browser.socket.send_bytes(bytes(view.picture.data))
                        shown = view.picture
            except (TimeoutError, ConnectionError, RuntimeError):
                await browser.socket.close()
                return

    def _seen_by(self, seat: str, view: View) -> View:
        """A view with what only the hand knows."""
        if self._hand is None:
            return view
        return replace(view, confirmed=self._hand.confirmed, hand=self._hand.state() if seat == "yours" else None)


async def serve_page(
    server: PageServer,
    host: str,
    port: int,
    tls: ssl.SSLContext | None,
    ready: Callable[[int], None],
    stop: Event,
    alive: Callable[[], None] = lambda: None,
) -> None:
    """Serve until `stop` is set; `ready` gets the port, `alive` is called again and again.

    Raises `ConfigError` if the address cannot be had.
    """
    runner = web.AppRunner(server.application(), access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        site = web.TCPSite(runner, host, port, ssl_context=tls)
        try:
            await site.start()
        except OSError as error:
            raise ConfigError(
                f"cannot listen on {host}:{port}: {error.strerror}", "Is another one running? Choose --port."
            ) from error
        ready(runner.addresses[0][1])
        while not stop.is_set():
            alive()
            await asyncio.sleep(LOOK_S)
    finally:
        await runner.cleanup()
