"""How a sender notes its commands: each motion is marked, so that the wheels' own log shows whose it was, and how old.

The mark is an angular velocity of at most 1 mrad/s, different for each command that is put on the bus, repetitions
included. No limit of a profile touches it, and a zero stays a zero.
"""

import os
import time
from pathlib import Path
from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.topics import CMD_VEL, TELEOP
from lira.hal.messages import Twist, is_neutral
from lira.tools.stop_test.journal import SENDERS, JournalWriter, Sent

SENDER_RAD_S, TICK_RAD_S = 1e-4, 1e-13
TICK_S, TICKS = 1e-6, 10**9  # marks return after 1,000 s, long after their journal was read


class Pen:
    """Marks what one sender sends, and notes it in the journal in `folder`.

    In a file that is as young as the process: a full disk, which is a limit on any file, does not stop the notes.
    """

    def __init__(self, folder: Path, who: str) -> None:
        self._journal = JournalWriter(folder, f"{who}-{os.getpid()}")
        self._who = who
        self._mark_rad_s = (1 + SENDERS.index(who)) * SENDER_RAD_S

    def mark(self, twist: Twist) -> Twist:
        """Return the command as it has to be sent, now."""
        now_s = time.monotonic()
        if not is_neutral(twist):
            mark = self._mark_rad_s + round(now_s / TICK_S) % TICKS * TICK_RAD_S
            angular = twist.angular_rad_s - mark if twist.angular_rad_s > 0.0 else twist.angular_rad_s + mark
            twist = Twist(twist.linear_m_s, angular)
        self._journal.note(Sent(now_s, self._who, twist.linear_m_s, twist.angular_rad_s))
        return twist

    def close(self) -> None:
        """Note no more."""
        self._journal.close()


def note_commands(folder: Path, who: str) -> None:
    """From now on note every command that this process publishes."""
    pen, plain = Pen(folder, who), Bus.publisher

    def publisher(bus: Bus, topic: Any, *more: Any) -> Publisher[Any]:
        made = plain(bus, topic, *more)
        if topic.key in (CMD_VEL.key, TELEOP.key):
            put = made.put
            setattr(made, "put", lambda twist, *words, **named: put(pen.mark(twist), *words, **named))  # noqa: B010
        return made

    setattr(Bus, "publisher", publisher)  # noqa: B010 - to a type checker a method is no variable
