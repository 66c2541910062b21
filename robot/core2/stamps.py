"""When the board measured what it says, on our clock. Pure; the time comes in."""

import math

AHEAD_S = 0.25  # a board whose clock is set runs no further ahead of ours


class Stamps:
    """The board stamps with the time that it was told: what it says is believed from then on, however late it comes.

    Before that, and if its clock is not ours after all, a reading is of when it came. No topic's stamps run back.
    """

    def __init__(self) -> None:
        self._newest_s: dict[str, float] = {}
        self.forget()

    def forget(self) -> None:
        """The board has begun anew, and its clock with it."""
        self._told_s = math.inf

    def told(self, now_s: float) -> None:
        """It was told the time."""
        self._told_s = min(self._told_s, now_s)

    def of(self, topic: str, said_s: float, now_s: float) -> float:
        """Stamp of a reading that came at `now_s` and says that it is of `said_s`."""
        ours = self._told_s - AHEAD_S <= said_s <= now_s + AHEAD_S
        stamp_s = max(min(said_s, now_s) if ours else now_s, self._newest_s.get(topic, -math.inf))
        self._newest_s[topic] = stamp_s
        return stamp_s
