"""What a HAL server takes in: commands, as they came."""

from collections import deque

from hal.bus import Bus, Reader, Received
from hal.governor import is_neutral
from hal.messages import Command, Source, Twist
from hal.topics import CMD_VEL, ESTOP, TELEOP, Topic, commander_of, named

SEEN = 256
EPOCHS = 1 << 64
DEPTH = 32  # a neutral command must not be lost under the motion that follows it


class Inlet:
    """Reads the command topics."""

    def __init__(self, bus: Bus) -> None:
        self._policy = _readers(bus, CMD_VEL)
        self._teleop = _readers(bus, TELEOP)
        self._estop = bus.reader(ESTOP, DEPTH)
        self._seen: deque[tuple[int, int]] = deque(maxlen=SEEN)
        self.nameless = 0  # commands that came with nothing to tell whose they are

    def policy(self, now_s: float) -> list[Command]:
        """Return policy's commands since the last time, oldest first."""
        return self._commands(self._policy, Source.POLICY, now_s)

    def teleop(self, now_s: float) -> list[Command]:
        """Return teleop's commands since the last time, oldest first."""
        return self._commands(self._teleop, Source.TELEOP, now_s)

    def estop(self) -> bool:
        """Whether anybody pressed the emergency stop since the last time.

        The bus shows a latched message again to whoever reconnects: what was seen once does not press twice.
        """
        pressed = False
        for received in self._estop.poll():
            sent = received.attachment
            known = sent is not None and (sent.epoch, sent.seq) in self._seen
            if sent is not None and not known:
                self._seen.append((sent.epoch, sent.seq))
            pressed |= received.message.data and not known
        return pressed

    @property
    def dropped(self) -> int:
        """How many payloads were no commands."""
        commands = sum(sum(reader.dropped.values()) for reader in (*self._policy, *self._teleop))
        return commands + sum(self._estop.dropped.values())

    def _commands(self, readers: list[Reader[Twist]], source: Source, now_s: float) -> list[Command]:
        commands = []
        for received in (received for reader in readers for received in reader.poll()):
            if received.attachment is None and not received.sender:
                self.nameless += 1
            else:
                commands.append(_command(received, source, now_s))
        return commands


def _readers(bus: Bus, topic: Topic[Twist]) -> list[Reader[Twist]]:
    """Of the plain topic, where names do not matter or are not known (ROS bridges'), and of those with a name."""
    return [bus.reader(topic, DEPTH), *([bus.reader(named(topic, "*"), DEPTH)] if bus.encrypted else [])]


def _command(received: Received[Twist], source: Source, now_s: float) -> Command:
    """Its time is the sender's. A sample without our attachment (a ROS peer's) is judged by its arrival, and its hand
    lets go with a zero: it cannot say so in another way. Such peers are told apart by the id of their session.
    """
    twist, sent, commander = received.message, received.attachment, commander_of(received.key)
    if sent is None:
        let_go = source is Source.TELEOP and is_neutral(twist)
        epoch = int(received.sender, 16) % EPOCHS
        return Command(twist, now_s, source, released=let_go, epoch=epoch, commander=commander)
    return Command(twist, sent.time_s, source, sent.answers, sent.released, sent.epoch, sent.seq, commander)
