"""Who commands from a ROS graph, and how old a command is when it comes. Pure; every time comes in as an argument.

A sample of rmw_zenoh says who sent it and when, on the clock of the sender's machine, and a TwistStamped besides when
it was decided. So a command that a link held back is told from a fresh one, and every publisher is a commander of its
own to the robot, as if it were on the bus itself.
"""

from collections import OrderedDict
from dataclasses import dataclass
from hashlib import blake2b

from lira.hal.rmw.attachment import RmwAttachment

MOST = 64  # commanders that are remembered
DRIFT = 1e-3  # by which a clock may run slower than this machine's
AHEAD_S = 0.1  # a stamp further ahead of its own sending is of another clock
NO_SENDER, NO_ORDER, OTHER_CLOCK = "no sender", "out of order", "stamped by another clock"


@dataclass(frozen=True, slots=True)
class Order:
    """A command as the bus has it: of the session `epoch`, its number there, and how long ago it was decided."""

    epoch: int
    seq: int
    age_s: float


class SenderClock:
    """How late messages come, by the most prompt one that ever came from the same sender.

    A clock that is set forward while it sends makes what comes next look fresh, as it is; one that is set back makes
    everything look late, until its publisher is started anew. A queue that builds up looks like the latter.
    """

    def __init__(self) -> None:
        self._offset_s = float("-inf")
        self._heard_s = 0.0

    def age(self, sent_s: float, arrived_s: float) -> float:
        """Seconds since it was sent, without the shortest way there is."""
        offset_s = sent_s - arrived_s
        self._offset_s = max(offset_s, self._offset_s - DRIFT * (arrived_s - self._heard_s))
        self._heard_s = arrived_s
        return self._offset_s - offset_s


class _Commander:
    def __init__(self, epoch: int) -> None:
        self.epoch = epoch
        self.clock = SenderClock()
        self.highest = -1


class Commanders:
    """All that ever commanded. `salt` is this process's secret: nobody else can act in the name of one of them."""

    def __init__(self, salt: bytes) -> None:
        self._salt = salt
        self._known: OrderedDict[bytes, _Commander] = OrderedDict()

    def judge(self, attached: RmwAttachment | None, stamp_s: float, arrived_s: float) -> Order | str:
        """Return a command's order, or why it is none.

        `stamp_s` is the header's, 0 for none, and `arrived_s` on this machine's monotonic clock.
        """
        if attached is None:
            return NO_SENDER
        commander = self._known.pop(attached.gid, None) or _Commander(self._epoch(attached.gid))
        self._known[attached.gid] = commander
        if len(self._known) > MOST:
            self._known.popitem(last=False)
        if attached.number <= commander.highest:
            return NO_ORDER
        commander.highest = attached.number
        sent_s = attached.time_ns / 1e9
        age_s = commander.clock.age(sent_s, arrived_s)
        thought_s = sent_s - stamp_s if stamp_s else 0.0
        if thought_s < -AHEAD_S:
            return OTHER_CLOCK
        return Order(commander.epoch, attached.number, age_s + max(thought_s, 0.0))

    def _epoch(self, gid: bytes) -> int:
        return int.from_bytes(blake2b(gid, key=self._salt, digest_size=8).digest())
