"""Foxglove: a server that its app connects to. Each topic of the bus is a channel, and its payload passes as it is.

Whoever connects can subscribe and nothing else: the server offers no way to publish, call or set anything.
"""

import logging
import threading
from collections.abc import Collection, Sequence
from typing import Any

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener

from lira.hal.bus.topics import Topic
from lira.hal.errors import ConfigError
from lira.hal.messages.ros.types import definition
from lira.tools.view.source import Sample

BACKLOG = 256  # messages that wait for one client; then the oldest go


class FoxgloveViewer:
    """Serves topics until closed. Raises `ConfigError` if the address cannot be had.

    Memory is bounded whatever clients do: what waits for one that does not read is dropped, and one that does not even
    take the list of channels is cut off.
    """

    def __init__(self, robot: str, topics: Sequence[Topic[Any]], host: str = "127.0.0.1", port: int = 8765) -> None:
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)  # what a client does wrong is no news
        self._context = foxglove.Context()
        self._channels = {topic.key: _channel(f"/{robot}/{topic.key}", topic, self._context) for topic in topics}
        self._latched: dict[str, Sample | None] = {topic.key: None for topic in topics if topic.qos.latched}
        self._late = _LateSubscribers(self._channels)
        try:
            self._server = foxglove.start_server(
                name=f"lira {robot}",
                host=host,
                port=port,
                server_listener=self._late,
                supported_encodings=[],
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except RuntimeError as error:
            raise ConfigError(
                f"cannot listen on {host}:{port}: {error}", "Is another one running? Choose --port."
            ) from error

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.port

    @property
    def link(self) -> str:
        """Address that opens Foxglove in a browser with this as its source."""
        return self._server.app_url() or ""

    def wanted(self) -> Collection[str]:
        """Keys of the topics that anybody is subscribed to."""
        wanted = [key for key, channel in self._channels.items() if channel.has_sinks()]
        for key in self._latched.keys() - set(wanted):
            self._latched[key] = None  # it may change while nobody looks
        return wanted

    def show(self, samples: Sequence[Sample]) -> None:
        """Send samples; whoever subscribes to a latched topic gets its last one."""
        for key in self._late.take():
            if (last := self._latched.get(key)) is not None:
                self._send(last)
        for sample in samples:
            if sample.topic.key in self._latched:
                self._latched[sample.topic.key] = sample
            self._send(sample)

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def _send(self, sample: Sample) -> None:
        self._channels[sample.topic.key].log(sample.payload, log_time=sample.time_ns)


class _LateSubscribers(ServerListener):
    """Notes who subscribes; called by a thread of the server."""

    def __init__(self, channels: dict[str, foxglove.Channel]) -> None:
        self._keys = {channel.id(): key for key, channel in channels.items()}
        self._lock = threading.Lock()
        self._new: set[str] = set()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002 - foxglove's signature
        """Note one."""
        with self._lock:
            self._new |= {self._keys[channel.id]} if channel.id in self._keys else set()

    def take(self) -> set[str]:
        """Return the topics that somebody has subscribed to since the last time."""
        with self._lock:
            new, self._new = self._new, set()
        return new


def _channel(name: str, topic: Topic[Any], context: foxglove.Context) -> foxglove.Channel:
    text = definition(topic.ros_type).encode()
    schema = foxglove.Schema(name=topic.ros_type, encoding="ros2msg", data=text)
    return foxglove.Channel(name, schema=schema, message_encoding="cdr", context=context)
