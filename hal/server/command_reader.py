"""What a HAL server takes in: commands, as they came."""

from collections import OrderedDict
from collections.abc import Hashable
from typing import Any

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.topics import CMD_VEL, ESTOP, TELEOP, Topic, named
from lira.hal.messages import Command, Source, Twist, TwistStamped, is_neutral
from lira.hal.profile import Control
from lira.hal.server.command_watch import CommandWatch, Noted

EPOCHS = 1 << 64
DEPTH = 32  # a neutral command must not be lost under the motion that follows it
ESTOP_DEPTH = 256
SESSIONS = 256  # whose count is remembered
BURST = 4  # a peer without attachments that says so much within one poll did not say it just now


class Order:
    """Tells what was sent before something else of the same session, or for the second time. Pure."""

    def __init__(self) -> None:
        self._highest: OrderedDict[Hashable, int] = OrderedDict()

    def is_new(self, session: Hashable, seq: int) -> bool:
        """Whether nothing that was sent later in its session came before it; remembers it."""
        highest = self._highest.pop(session, -1)
        self._highest[session] = max(highest, seq)
        if len(self._highest) > SESSIONS:
            self._highest.popitem(last=False)
        return seq > highest


class Inlet:
    """Reads the command topics. `watch` gets to know who commands."""

    def __init__(self, bus: Bus, control: Control, watch: CommandWatch | None = None) -> None:
        watch = watch or CommandWatch()
        self._policy = _Commands(bus, CMD_VEL, Source.POLICY, watch, control.policy_timeout_s)
        self._teleop = _Commands(bus, TELEOP, Source.TELEOP, watch, control.teleop_timeout_s)
        self._estop = bus.reader(ESTOP, ESTOP_DEPTH)
        self._seen = Order()

    def policy(self, now_s: float) -> list[Command]:
        """Return policy's commands since the last time, oldest first."""
        return self._policy.take(now_s)

    def teleop(self, now_s: float) -> list[Command]:
        """Return teleop's commands since the last time, oldest first."""
        return self._teleop.take(now_s)

    def estop(self) -> bool:
        """Whether anybody pressed the emergency stop since the last time.

        The bus shows a latched message again to whoever reconnects: what was seen once does not press twice. So many
        messages at once that one may have been lost count as a press: it may have been that one.
        """
        new = [received for received in self._estop.poll() if self._is_new(received.attachment)]
        return self._estop.full or any(received.message.data for received in new)

    def _is_new(self, sent: Attachment | None) -> bool:
        return sent is None or self._seen.is_new(sent.epoch, sent.seq)


class _Commands:
    """One of the command topics."""

    def __init__(self, bus: Bus, topic: Topic[Twist], source: Source, watch: CommandWatch, timeout_s: float) -> None:
        # The plain topic, on which ROS bridges command too, and with keys those that carry a name.
        topics: list[Topic[Any]] = [topic, named(topic, "*")] if bus.encrypted else [topic]
        self._readers = [bus.reader(each, DEPTH) for each in topics]
        self._boundary = bus.boundary
        self._key = topic.key
        self._source = source
        self._watch = watch
        self._timeout_s = timeout_s
        self._order = Order()

    def take(self, now_s: float) -> list[Command]:
        """Return what came since the last time, oldest first."""
        came: list[Received[Twist | TwistStamped]] = [each for reader in self._readers for each in reader.poll()]
        bare = sum(_is_bare(received) for received in came)
        if bare >= BURST:
            # These are judged by when they come, and what a link has held back for seconds comes all at once.
            self._boundary.refuse(self._key, "burst", bare)
            came = [received for received in came if not _is_bare(received)]
        commands = [self._command(received, now_s) for received in came if self._has_sender(received)]
        return [command for command in commands if self._is_new(command)]

    def _has_sender(self, received: Received[Twist | TwistStamped]) -> bool:
        """Whether there is anything to tell whose it is."""
        if received.attachment is None and not received.sender:
            self._boundary.refuse(self._key, "no sender")
            return False
        return True

    def _is_new(self, command: Command) -> bool:
        """Whether its number grows; a peer without attachments has none."""
        if command.seq < 0 or self._order.is_new(command.token, command.seq):
            return True
        self._boundary.refuse(self._key, "out of order")
        return False

    def _command(self, received: Received[Twist | TwistStamped], now_s: float) -> Command:
        """Its time is the sender's. A sample without our attachment (a ROS peer's) is judged by its stamp, and one
        without that by its arrival. Its hand lets go with a zero: it cannot say so in another way. Such peers are told
        apart by the id of their session.
        """
        message, sent, commander = received.message, received.attachment, received.commander
        twist = message.twist if isinstance(message, TwistStamped) else message
        self._watch.note_sender(received.sender, received.arrived_s)
        if sent is None:
            stamp_s = _stamp(received)
            age_s = None if stamp_s is None else now_s - stamp_s
            noted = Noted(received.arrived_s, age_s, not is_neutral(twist))
            self._watch.note_ros(self._key, received.sender, self._timeout_s, noted)
            released = self._source is Source.TELEOP and is_neutral(twist)
            epoch = int(received.sender, 16) % EPOCHS
            told_s = now_s if stamp_s is None else stamp_s
            return Command(twist, told_s, self._source, released=released, epoch=epoch, commander=commander)
        return Command(twist, sent.time_s, self._source, sent.answers, sent.released, sent.epoch, sent.seq, commander)


def _stamp(received: Received[Twist | TwistStamped]) -> float | None:
    """When a ROS peer says that it decided; None for one that does not. A stamp of 0 is ROS's word for none."""
    message = received.message
    return message.stamp_s if isinstance(message, TwistStamped) and message.stamp_s != 0.0 else None


def _is_bare(received: Received[Twist | TwistStamped]) -> bool:
    """Whether nothing but its arrival tells when it was said."""
    return received.attachment is None and _stamp(received) is None
