"""A relay between a robot and its driver, in user space, TCP and UDP on one port: it can fail like a bad link.

Change `faults` at any time, from any thread. While `dark`, datagrams are lost, and streams held and delivered late, as
TCP does; `delay_s` holds everything back, `copies` sends every datagram more than once, `swap` exchanges neighbours;
`lost` is the share of datagrams that do not arrive, `narrow_byte_s` all that fits through in a second either way: what
does not is lost if it is a datagram, and waits if it is of a stream.

python -m lira.tools.launch.link_fault PORT TARGET_PORT     the same as a process of its own, which can be killed
"""

import asyncio
import contextlib
import math
import random
import sys
import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, cast

CHUNK = 65536
PACKET = 500  # of a stream, where it is narrow
QUEUE_S = 0.1  # datagrams that would wait longer are lost
LOOK_S = 0.01
READY_S = 5.0
READY = "passes on"


@dataclass(slots=True)
class LinkFaults:
    """What is wrong with the link now."""

    dark: bool = False
    delay_s: float = 0.0
    copies: int = 1
    swap: bool = False
    lost: float = 0.0
    narrow_byte_s: float = math.inf


class Narrows:
    """How long what goes through has to wait, where only so much fits. Pure; the time comes in."""

    def __init__(self) -> None:
        self._free_s = -math.inf

    def pass_s(self, size: int, byte_s: float, now_s: float) -> float:
        """Take this much, and return how long it is until all of it is through."""
        self._free_s = now_s + self.queue_s(now_s) + size / byte_s
        return self._free_s - now_s

    def queue_s(self, now_s: float) -> float:
        """How long what comes now would wait for what is before it."""
        return max(self._free_s - now_s, 0.0)


class Relay:
    """Listens on `port` of this machine and passes everything to `target_port`. Leaving its `with` block ends it."""

    def __init__(self, port: int, target_port: int) -> None:
        self.faults = LinkFaults()
        self._ports = port, target_port
        self.to_robot, self.from_robot = Narrows(), Narrows()
        self.chance = random.Random(0)
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._streams: set[asyncio.StreamWriter] = set()
        self._datagrams: list[asyncio.BaseTransport] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)

    def __enter__(self) -> "Relay":
        self._thread.start()
        if not self._ready.wait(READY_S):
            raise TimeoutError("the relay does not start")
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def cut(self) -> None:
        """Break every stream that is open."""
        self._loop.call_soon_threadsafe(self._abort)

    def _abort(self) -> None:
        for stream in self._streams:
            stream.transport.abort()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(self._open())
        self._ready.set()
        self._loop.run_forever()
        server.close()
        self._abort()
        for transport in self._datagrams:
            transport.close()
        for task in self._tasks:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*self._tasks, return_exceptions=True))
        self._loop.run_until_complete(asyncio.sleep(0))  # what was closed is let go of on the loop's next turn
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    async def _open(self) -> asyncio.Server:
        port, target_port = self._ports
        await self._loop.create_datagram_endpoint(lambda: _Front(self, target_port), local_addr=("127.0.0.1", port))
        return await asyncio.start_server(self._accept, "127.0.0.1", port)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._ports[1])
        except OSError:
            writer.close()
            return
        self.start(self._pump(reader, far_writer, self.to_robot))
        self.start(self._pump(far_reader, writer, self.from_robot))

    def keep(self, transport: asyncio.BaseTransport) -> None:
        """Close a transport with the relay."""
        self._datagrams.append(transport)

    def start(self, work: Coroutine[Any, Any, None]) -> None:
        """Run something until it ends or the relay does."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, narrows: Narrows) -> None:
        self._streams.add(writer)
        faults = self.faults
        try:
            while data := await reader.read(CHUNK if faults.narrow_byte_s == math.inf else PACKET):
                await asyncio.sleep(faults.delay_s)
                while faults.dark:
                    await asyncio.sleep(LOOK_S)
                await asyncio.sleep(narrows.pass_s(len(data), faults.narrow_byte_s, self._loop.time()))
                writer.write(data)
                await writer.drain()
        except OSError:
            pass  # the other side is gone: so is this one
        finally:
            self._streams.discard(writer)
            with contextlib.suppress(RuntimeError):  # the loop may be closed already
                writer.close()


class _Front(asyncio.DatagramProtocol):
    """Faces the driver: one far socket for each of its addresses."""

    def __init__(self, relay: Relay, target_port: int) -> None:
        self._relay = relay
        self._target_port = target_port
        self._far: dict[tuple[str, int], _Sender] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._relay.keep(transport)
        self._near = cast(asyncio.DatagramTransport, transport)  # it is one, if not by inheritance

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        if addr not in self._far:
            self._far[addr] = _Sender(self._relay, self._relay.to_robot)
            self._relay.start(self._connect(addr, data))
        else:
            self._far[addr].send(data)

    async def _connect(self, addr: tuple[str, int], first: bytes) -> None:
        loop = asyncio.get_running_loop()
        back = _Sender(self._relay, self._relay.from_robot)
        back.open(lambda data: _put(self._near, data, addr))
        there, _ = await loop.create_datagram_endpoint(
            lambda: _Back(back), remote_addr=("127.0.0.1", self._target_port)
        )
        self._relay.keep(there)
        self._far[addr].open(lambda data: _put(there, data))
        self._far[addr].send(first)


def _put(transport: asyncio.DatagramTransport, data: bytes, addr: tuple[str, int] | None = None) -> None:
    """Send a datagram that may have been held back until the relay ends."""
    if not transport.is_closing():
        transport.sendto(data, addr)


class _Back(asyncio.DatagramProtocol):
    """Faces the robot."""

    def __init__(self, sender: "_Sender") -> None:
        self._sender = sender

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:  # noqa: ARG002 - asyncio's
        self._sender.send(data)


class _Sender:
    """Sends datagrams one way, as badly as asked."""

    def __init__(self, relay: Relay, narrows: Narrows) -> None:
        self._faults, self._chance = relay.faults, relay.chance
        self._narrows = narrows
        self._put: Callable[[bytes], None] | None = None
        self._held: bytes | None = None

    def open(self, put: Callable[[bytes], None]) -> None:
        self._put = put

    def send(self, data: bytes) -> None:
        faults = self._faults
        if faults.dark or self._put is None or self._chance.random() < faults.lost:
            return
        if faults.swap and self._held is None:
            self._held = data
            return
        for one in (data, self._held):
            if one is not None:
                for _ in range(faults.copies):
                    self._send(one, self._put)
        self._held = None

    def _send(self, data: bytes, put: Callable[[bytes], None]) -> None:
        loop, faults = asyncio.get_running_loop(), self._faults
        if self._narrows.queue_s(loop.time()) <= QUEUE_S:
            passed_s = self._narrows.pass_s(len(data), faults.narrow_byte_s, loop.time())
            loop.call_later(faults.delay_s + passed_s, put, data)


def main(port: int, target_port: int) -> None:
    """Pass on until killed."""
    with Relay(port, target_port):
        print(READY, flush=True)
        threading.Event().wait()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
