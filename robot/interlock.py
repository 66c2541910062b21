"""What keeps a robot standing while something it needs is lost, and until a neutral command after that."""

import threading

from hal.messages import STOP, Reason, Twist


class Interlock:
    """Judges every command. May be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._armed = False

    def judge(self, twist: Twist, lost: tuple[str, ...]) -> tuple[Twist, Reason, tuple[str, ...]]:
        """Return what may be driven, why, and the clamps that say so. `lost` names what is missing, as clamps."""
        with self._lock:
            if lost:
                self._armed = False
                return STOP, Reason.STALE, lost
            if not self._armed:
                self._armed = twist == STOP
                if not self._armed:
                    return STOP, Reason.NEUTRAL_FIRST, ("neutral_first",)
            return twist, Reason.OK, ()
