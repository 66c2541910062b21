"""What a HAL server takes in: commands, as they came."""

from hal.attachment import Attachment
from hal.bus import Bus, Reader, Received
from hal.messages import Command, Source, Twist
from hal.topics import CMD_VEL, TELEOP

DEPTH = 32  # a neutral command must not be lost under the motion that follows it


class Inlet:
    """Reads the command topics."""

    def __init__(self, bus: Bus) -> None:
        self._policy = bus.reader(CMD_VEL, DEPTH)
        self._teleop = bus.reader(TELEOP, DEPTH)

    def policy(self, now_s: float) -> list[Command]:
        """Return policy's commands since the last time, oldest first."""
        return _commands(self._policy, Source.POLICY, now_s)

    def teleop(self, now_s: float) -> list[Command]:
        """Return teleop's commands since the last time, oldest first."""
        return _commands(self._teleop, Source.TELEOP, now_s)

    @property
    def dropped(self) -> int:
        """How many payloads were no commands."""
        return sum((self._policy.dropped + self._teleop.dropped).values())


def _commands(reader: Reader[Twist], source: Source, now_s: float) -> list[Command]:
    return [_command(received, source, now_s) for received in reader.poll()]


def _command(received: Received[Twist], source: Source, now_s: float) -> Command:
    """Its time is the sender's; a sample without our attachment (a ROS peer's) is judged by its arrival."""
    attachment = received.attachment or Attachment(0, 0, round(now_s * 1e9))
    return Command(received.message, attachment.time_s, source, attachment.answers, attachment.released)
