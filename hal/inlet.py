"""What a HAL server takes in: commands, as they came."""

from collections import deque

from hal.bus import Bus, Reader, Received
from hal.governor import is_neutral
from hal.messages import Command, Source, Twist
from hal.topics import CMD_VEL, ESTOP, TELEOP

SEEN = 256
DEPTH = 32  # a neutral command must not be lost under the motion that follows it


class Inlet:
    """Reads the command topics."""

    def __init__(self, bus: Bus) -> None:
        self._policy = bus.reader(CMD_VEL, DEPTH)
        self._teleop = bus.reader(TELEOP, DEPTH)
        self._estop = bus.reader(ESTOP, DEPTH)
        self._seen: deque[tuple[int, int]] = deque(maxlen=SEEN)

    def policy(self, now_s: float) -> list[Command]:
        """Return policy's commands since the last time, oldest first."""
        return _commands(self._policy, Source.POLICY, now_s)

    def teleop(self, now_s: float) -> list[Command]:
        """Return teleop's commands since the last time, oldest first."""
        return _commands(self._teleop, Source.TELEOP, now_s)

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
        return sum((self._policy.dropped + self._teleop.dropped + self._estop.dropped).values())


def _commands(reader: Reader[Twist], source: Source, now_s: float) -> list[Command]:
    return [_command(received, source, now_s) for received in reader.poll()]


def _command(received: Received[Twist], source: Source, now_s: float) -> Command:
    """Its time is the sender's. A sample without our attachment (a ROS peer's) is judged by its arrival, and its hand
    lets go with a zero: it cannot say so in another way.
    """
    twist, sent = received.message, received.attachment
    if sent is None:
        return Command(twist, now_s, source, released=source is Source.TELEOP and is_neutral(twist))
    return Command(twist, sent.time_s, source, sent.answers, sent.released, sent.epoch, sent.seq)
