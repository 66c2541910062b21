"""A client of Foxglove's websocket protocol, by its published description, with the decoder of mcap-ros2-support."""

import asyncio
import json
import struct
from dataclasses import dataclass

import aiohttp
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

PROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 0x01


@dataclass
class Shown:
    topic: str
    time_ns: int
    data: bytes
    message: object


class FoxgloveClient:
    """What `connect` gives: the server's words, its channels by topic below the robot's name, and subscriptions."""

    def __init__(self, socket):
        self.socket = socket
        self.info = None
        self.channels = {}
        self._numbers = {}
        self._factory = DecoderFactory()

    async def begin(self):
        while not (self.info and self.channels):
            self._note(json.loads(await self.socket.receive_str(timeout=10)))
        return self

    async def subscribe(self, *topics):
        wanted = []
        for topic in topics:
            number = len(self._numbers) + 1
            self._numbers[number] = topic
            wanted.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self.say(op="subscribe", subscriptions=wanted)

    async def say(self, **words):
        await self.socket.send_str(json.dumps(words))

    async def next(self, timeout_s=10.0):
        """The next message of a channel."""
        async with asyncio.timeout(timeout_s):
            while True:
                answer = await self.socket.receive()
                if answer.type is aiohttp.WSMsgType.TEXT:
                    self._note(json.loads(answer.data))
                elif answer.type is aiohttp.WSMsgType.BINARY and answer.data[0] == MESSAGE_DATA:
                    return self._shown(answer.data)
                elif answer.type in (aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSING):
                    raise ConnectionError(f"the server closed: {answer}")

    async def first_of_each(self, topics, timeout_s=20.0):
        """The first message of each of these topics."""
        found = {}
        async with asyncio.timeout(timeout_s):
            while set(topics) - set(found):
                shown = await self.next(timeout_s)
                found.setdefault(shown.topic, shown)
        return found

    def _note(self, words):
        if words["op"] == "serverInfo":
            self.info = words
        elif words["op"] == "advertise":
            self.channels |= {f"/{each['topic'].split('/', 2)[2]}": each for each in words["channels"]}

    def _shown(self, data):
        number, time_ns = struct.unpack_from("<IQ", data, 1)
        topic = self._numbers[number]
        channel = self.channels[topic]
        schema = Schema(channel["id"], channel["schema"].encode(), channel["schemaEncoding"], channel["schemaName"])
        decode = self._factory.decoder_for(channel["encoding"], schema)
        return Shown(topic, time_ns, data[13:], decode(data[13:]))


async def connect(session, port):
    """Open a connection to a server on this machine."""
    socket = await session.ws_connect(f"ws://127.0.0.1:{port}", protocols=[PROTOCOL], max_msg_size=0)
    return await FoxgloveClient(socket).begin()
