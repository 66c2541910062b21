"""How soon a robot does what it is told: every scan is answered, and timed until the wheels got the answer."""

from lira.hal.bus.topics import APPLIED, SCAN
from lira.hal.client.remote import RemoteRobot
from lira.hal.messages import Command, Twist


class Answers:
    """Answers every scan of a robot with one twist."""

    def __init__(self, robot: RemoteRobot, twist: Twist) -> None:
        self._robot, self._twist = robot, twist
        self._results = robot.bus.reader(APPLIED, depth=64)
        self._captured_s: dict[int, float] = {}  # of what is not applied yet
        self.scans = robot.bus.reader(SCAN)

    def poll(self) -> list[float]:
        """Answer what came, and return how long each answer took that was applied since, ms on the robot's clock."""
        for received in self.scans.poll():
            if received.attachment is not None:
                seq = received.attachment.seq
                self._captured_s[seq] = received.message.stamp_s
                self._robot.drive(Command(self._twist, self._robot.now(), answers=seq))
        applied = [result.message for result in self._results.poll()]
        return [
            1e3 * (each.stamp_s - captured_s)
            for each in applied
            if (captured_s := self._captured_s.pop(each.answers, None)) is not None
        ]
