"""When a message was recorded and sent, on one line of Unix time, whichever clock says so. Pure."""

from lira.hal.bus.attachment import Attachment

NEAR_NS = 5_000_000_000  # a sender whose clock is further off than that is not believed
LEAP_NS = 3600_000_000_000  # nor one who says that so much has passed at once, where time is the sender's


class TimeLine:
    """`offset_ns` turns times on the robot's clock into Unix time, and `local_ns` those of this machine's.

    In lockstep a minute of the robot's time may pass in a second, and what was recorded is to be looked at in the
    robot's time: there a message was recorded when it was sent.
    """

    def __init__(self, offset_ns: int, local_ns: int, *, lockstep: bool) -> None:
        self._offset_ns, self._local_ns, self._lockstep = offset_ns, local_ns, lockstep
        self._newest_ns = 0

    def times(self, arrived_s: float, sent: Attachment | None) -> tuple[int, int]:
        """Return when a message was recorded, which never runs back, and when it was sent."""
        log_ns = round(arrived_s * 1e9) + self._local_ns
        sent_ns = None if sent is None else sent.time_ns + self._offset_ns
        if self._lockstep:
            first_ns = self._newest_ns or self._offset_ns
            if sent_ns is not None and abs(sent_ns - first_ns) > LEAP_NS:
                sent_ns = None
            log_ns = first_ns if sent_ns is None else sent_ns
        elif sent_ns is not None and abs(sent_ns - log_ns) > NEAR_NS:
            sent_ns = None
        self._newest_ns = max(self._newest_ns, log_ns)
        return self._newest_ns, self._newest_ns if sent_ns is None else sent_ns
