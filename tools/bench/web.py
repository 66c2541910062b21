"""The page of `lira web` beside a twin that drives: what a browser fetches, how soon it sees, what it costs to show it.

Three clients read what pages read, each as fast as it comes; one of them has the controls and says so as a page does.
`core` is what the process of `lira web` needs of one core meanwhile.
"""

import asyncio
import time

import aiohttp

from lira.hal.errors import BusError
from lira.tools.bench import Row, cpu_s
from lira.tools.bench.parts.robots import READY_S, twin_at_work
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

CLIENTS = 3
WATCH_S = 8.0
PICTURE_S = 10.0
SAY_S = 0.04
FILES = ("/", "/static/page.css", "/static/page.js", "/static/hands.js", "/static/draw.js", "/static/icon.svg")


def run() -> list[Row]:
    """Return a row for what is fetched and how soon, and one for what it costs."""
    page = free_port()
    with twin_at_work("--world", "line-obstacles") as (name, endpoint, folder):
        web = lira_command("web", "--name", name, "--connect", endpoint, "--port", str(page))
        with ChildProcess("lira web", web, folder / "web.log") as shown:
            shown.wait_ready("web shows", READY_S)
            return asyncio.run(measure(f"http://127.0.0.1:{page}", shown.pid))


async def measure(url: str, pid: int) -> list[Row]:
    """Both rows, for the page at `url` that the process serves."""
    async with aiohttp.ClientSession() as session:
        began_s = time.monotonic()
        loaded = [await fetch(session, url + path) for path in (*FILES, "/settings.json?language=en")]
        async with session.ws_connect(f"{url}/socket") as socket:
            picture_bytes = await first_picture(socket)
            first_ms = 1e3 * (time.monotonic() - began_s)
        before_s, watched_s = cpu_s(pid), time.monotonic()
        counts = await asyncio.gather(*(look(session, url, drives=number == 0) for number in range(CLIENTS)))
        core = (cpu_s(pid) - before_s) / (time.monotonic() - watched_s)
    frames, pictures = (sum(each) / CLIENTS / WATCH_S for each in zip(*counts, strict=True))
    sizes: Row = {"files": len(loaded), "KiB": sum(loaded) / 1024, "picture_KiB": picture_bytes / 1024}
    return [
        {"what": "to the first picture", "ms": first_ms, **sizes},
        {"what": f"{CLIENTS} clients", "core": core, "frames_hz": frames, "pictures_hz": pictures},
    ]


async def fetch(session: aiohttp.ClientSession, url: str) -> int:
    """Return how many bytes a file has. Raises `aiohttp.ClientError` if there is none."""
    async with session.get(url, raise_for_status=True) as answer:
        return len(await answer.read())


async def first_picture(socket: aiohttp.ClientWebSocketResponse) -> int:
    """Wait for the camera, and return the bytes of its picture. Raises `BusError` if none comes."""
    async with asyncio.timeout(PICTURE_S):
        async for message in socket:
            if message.type is aiohttp.WSMsgType.BINARY:
                return len(message.data)
    raise BusError("the page shows no picture", "Does the twin run?")


async def look(session: aiohttp.ClientSession, url: str, *, drives: bool) -> tuple[int, int]:
    """Read for a while. Returns how many frames and pictures came."""
    frames = pictures = 0
    async with session.ws_connect(f"{url}/socket") as socket:
        if drives:
            await socket.send_json({"type": "take", "sit": True})
        until_s, said_s = time.monotonic() + WATCH_S, 0.0
        while (now_s := time.monotonic()) < until_s:
            message = await socket.receive(PICTURE_S)
            pictures += message.type is aiohttp.WSMsgType.BINARY
            if message.type is aiohttp.WSMsgType.TEXT:
                frames += 1
                if drives and now_s >= said_s + SAY_S:
                    said_s = now_s
                    await socket.send_json({"type": "say", "input": {"seen": message.json()["time"]}})
    return frames, pictures
