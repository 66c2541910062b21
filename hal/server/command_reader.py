"""What a HAL server takes in: commands, as they came."""

from collections import OrderedDict
from collections.abc import Hashable

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.topics import CMD_VEL, ESTOP, TELEOP, Topic, named
from lira.hal.messages import Command, Source, Twist, is_neutral

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
    """Reads the command topics."""

    def __init__(self, bus: Bus) -> None:
        self._policy = _Commands(bus, CMD_VEL, Source.POLICY)
        self._teleop = _Commands(bus, TELEOP, Source.TELEOP)
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

    def __init__(self, bus: Bus, topic: Topic[Twist], source: Source) -> None:
        # The plain topic, on which ROS bridges command too, and with keys those that carry a name.
        topics = [topic, named(topic, "*")] if bus.encrypted else [topic]
        self._readers = [bus.reader(each, DEPTH) for each in topics]
        self._boundary = bus.boundary
        self._key = topic.key
        self._source = source
        self._order = Order()

    def take(self, now_s: float) -> list[Command]:
        """Return what came since the last time, oldest first."""
        came = [received for reader in self._readers for received in reader.poll()]
        bare = sum(received.attachment is None for received in came)
        if bare >= BURST:
            # These are judged by when they come, and what a link has held back for seconds comes all at once.
            self._boundary.refuse(self._key, "burst", bare)
            came = [received for received in came if received.attachment is not None]
        commands = [self._command(received, now_s) for received in came if self._has_sender(received)]
        return [command for command in commands if self._is_new(command)]

    def _has_sender(self, received: Received[Twist]) -> bool:
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

    def _command(self, received: Received[Twist], now_s: float) -> Command:
        """Its time is the sender's. A sample without our attachment (a ROS peer's) is judged by its arrival, and its
        hand lets go with a zero: it cannot say so in another way. Such peers are told apart by the id of their session.
        """
        twist, sent, commander = received.message, received.attachment, received.commander
        if sent is None:
            released = self._source is Source.TELEOP and is_neutral(twist)
            epoch = int(received.sender, 16) % EPOCHS
            return Command(twist, now_s, self._source, released=released, epoch=epoch, commander=commander)
        return Command(twist, sent.time_s, self._source, sent.answers, sent.released, sent.epoch, sent.seq, commander)
