"""The page's server over real sockets, without a robot: who gets in, one driver, and browsers that misbehave."""

import asyncio
import contextlib
import json
import os
import time

import aiohttp
import pytest
from aiohttp.test_utils import TestServer

from lira.hal.bus.services import Info
from lira.hal.messages import CompressedImage
from lira.hal.profile import load_profile
from lira.tools.operator.view import View
from lira.tools.web.access import Access, own_names
from lira.tools.web.seat import Control, Seat
from lira.tools.web.server import FRAMES_HZ, MOST_CLIENTS, PageServer
from lira.tools.web.settings import settings_of

INFO = Info(load_profile("thesis-sim"), "realtime", 0)
PICTURE = b"\xff\xd8 a picture " * 10


class NoHand:
    confirmed = False

    def __init__(self):
        self.stops = self.wakes = 0

    def state(self):
        return "ready"

    def wake(self):
        self.wakes += 1

    def press_stop(self):
        self.stops += 1


class Bed:
    """A server, its seat, and as many browsers as a test wants."""

    def __init__(self, *, open_here=True):
        self.seat, self.hand = Seat(), NoHand()
        self.access = Access(open_here=open_here, hosts=own_names("127.0.0.1"))
        look = lambda: View("rosbot", picture=CompressedImage(0.0, PICTURE), picture_age_s=0.0)  # noqa: E731
        settings = lambda language, layout=None: settings_of(INFO, "rosbot", 0, language, layout)  # noqa: E731
        self.page = PageServer(look, self.seat, self.access, self.hand, settings, say=lambda _: None)

    async def __aenter__(self):
        self.stack = contextlib.AsyncExitStack()
        self.server = await self.stack.enter_async_context(TestServer(self.page.application()))
        self.http = await self.stack.enter_async_context(
            aiohttp.ClientSession(self.server.make_url("/"), cookie_jar=aiohttp.CookieJar(unsafe=True))
        )
        return self

    async def __aexit__(self, *failure):
        await self.stack.aclose()

    async def browser(self, **words):
        return await self.stack.enter_async_context(self.http.ws_connect("/socket", **words))


def on(bed):
    """Run a test's coroutine beside a server."""

    def decorate(test):
        async def inside():
            async with bed() as made:
                async with asyncio.timeout(20):
                    await test(made)

        def run():
            asyncio.run(inside())

        run.__name__ = test.__name__
        return run

    return decorate


async def frame(browser, condition=lambda _: True):
    """The next frame for which the condition holds."""
    while True:
        message = await browser.receive()
        if message.type is aiohttp.WSMsgType.TEXT and condition(found := json.loads(message.data)):
            return found
        assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message


async def sit(browser):
    await browser.send_json({"type": "take", "sit": True})
    return await frame(browser, lambda seen: seen["seat"] == "yours")


def fresh(seen):
    """Whether a frame is not one of those that have waited to be read."""
    return time.monotonic() - seen["time"] < 0.05


def word(seen, **words):
    return {"type": "say", "input": {"seen": seen["time"], **words}}


@on(Bed)
async def test_the_page_and_all_its_parts_come_from_here(bed):
    for path in ("/", "/static/page.js", "/static/draw.js", "/static/hands.js", "/static/page.css", "/settings.json"):
        async with bed.http.get(path) as answer:
            assert answer.status == 200
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    async with bed.http.get("/static/../server.py") as answer:
        assert answer.status == 404


@on(Bed)
async def test_another_host_or_another_page_gets_nothing(bed):
    for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
        async with bed.http.get("/", headers=headers) as answer:
            assert answer.status == 403
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await bed.browser(headers=headers)
        assert refused.value.status == 403


@on(lambda: Bed(open_here=False))
async def test_without_a_link_nobody_gets_in_and_with_one_once(bed):
    for path in ("/", "/settings.json", "/static/page.js", "/enter/guessed"):
        async with bed.http.get(path) as answer:
            assert answer.status == 403
    with pytest.raises(aiohttp.WSServerHandshakeError):
        await bed.browser()
    link = bed.access.new_link(time.monotonic(), drives=False)
    async with bed.http.get(f"/enter/{link}") as answer:
        assert answer.status == 200
    viewer = await bed.browser()
    await viewer.send_json({"type": "take", "sit": True})
    assert (await frame(viewer))["seat"] == "viewer"
    await viewer.send_json({"type": "stop"})
    while not bed.hand.stops:
        await asyncio.sleep(0.01)
    assert bed.seat.holder() is None
    bed.http.cookie_jar.clear()
    async with bed.http.get(f"/enter/{link}") as answer:
        assert answer.status == 403


@on(Bed)
async def test_one_drives_and_the_other_looks_until_the_first_goes(bed):
    first, second = await bed.browser(), await bed.browser()
    seen = await sit(first)
    await second.send_json({"type": "take", "sit": True})
    assert (await frame(second, lambda each: each["seat"] != "free"))["seat"] == "taken"
    await second.send_json(word(seen, forward=1.0, held=["dead_man"]))
    await first.send_json(word(await frame(first, fresh), held=["turbo"]))
    while not (heard := bed.seat.take_said()):
        await asyncio.sleep(0.01)
    assert [said.held for said in heard] == [(Control.TURBO,)]
    await first.close()
    await frame(second, lambda each: each["seat"] == "free")
    await sit(second)


NONSENSE = [
    "",
    "{}",
    "[]",
    "null",
    '{"type":"say"}',
    '{"type":"jump"}',
    '{"type":"say","input":{"seen":"now"}}',
    "[" * 2000,
    "\u0000",
    '{"type":"take","sit":"yes"}',
]


@on(Bed)
async def test_nonsense_costs_its_sender_the_socket_and_nobody_else_anything(bed):
    good = await bed.browser()
    await sit(good)
    random = os.urandom(500 * 40)
    lines = [*NONSENSE, *(random[40 * k : 40 * k + 40].hex() for k in range(500))]
    for line in lines:
        async with bed.http.ws_connect("/socket") as bad:
            await bad.send_str(line)
            while not bad.closed:
                await bad.receive()
            assert bad.close_code == aiohttp.WSCloseCode.POLICY_VIOLATION, line
    async with bed.http.ws_connect("/socket") as bad:
        await bad.send_bytes(random[:100])
        while not bad.closed:
            await bad.receive()
    await good.send_json(word(await frame(good, fresh), forward=0.5))
    while not bed.seat.take_said():
        await asyncio.sleep(0.01)


@on(Bed)
async def test_who_says_too_much_or_too_long_is_not_heard(bed):
    for line in ('{"type":"take","sit":false}', "x" * 5000):
        async with bed.http.ws_connect("/socket") as bad:
            with contextlib.suppress(ConnectionError):
                for _ in range(1000):
                    await bad.send_str(line)
            while not bad.closed:
                await bad.receive()


@on(Bed)
async def test_a_browser_that_reads_nothing_holds_nobody_up(bed):
    slow, quick = await bed.browser(), await bed.browser()
    slow._response.connection.transport.pause_reading()
    began_s, count = time.monotonic(), 0
    while time.monotonic() - began_s < 2.0:
        await frame(quick)
        count += 1
    assert count > 2.0 * FRAMES_HZ / 3


@on(Bed)
async def test_more_browsers_than_there_is_room_for_are_told_so(bed):
    for _ in range(MOST_CLIENTS):
        await bed.browser()
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        await bed.browser()
    assert refused.value.status == 503


@on(Bed)
async def test_pictures_go_as_they_came(bed):
    browser = await bed.browser()
    while (message := await browser.receive()).type is not aiohttp.WSMsgType.BINARY:
        pass
    assert message.data == PICTURE
