"""Noticing a pad that is still there and says nothing any more. Pure: the time is handed in.

A DualShock 3 reports its motion sensors all the time, and its sticks tremble: a live one is never silent. When its
radio is lost, the system keeps the last state for seconds, and the robot would keep driving on it.
"""

from collections import deque

GAPS = 50  # so many gaps between events are learned from
MARGIN = 5.0  # a silence is a freeze when it is so many times the longest of them,
SHORTEST_S, LONGEST_S = 0.10, 0.40  # and within these


class FreezeWatch:
    """Learns how long one pad is silent at most, and says when it is silent for longer.

    `known_s` is the time-out that was learned earlier: it holds until there is a new one.
    """

    def __init__(self, known_s: float | None = None) -> None:
        self._known_s = known_s
        self._gaps_s: deque[float] = deque(maxlen=GAPS)
        self._last_s: float | None = None

    @property
    def timeout_s(self) -> float | None:
        """Silence that counts as a freeze; None until enough of the pad's events were seen, now or earlier."""
        return self._known_s if self.learned_s is None else self.learned_s

    @property
    def learned_s(self) -> float | None:
        """As `timeout_s`, from the events that came now."""
        if len(self._gaps_s) < GAPS:
            return None
        return min(LONGEST_S, max(SHORTEST_S, MARGIN * max(self._gaps_s)))

    def note(self, now_s: float) -> None:
        """Something came from the pad or its motion sensors. After a freeze it has to prove itself anew."""
        if self._last_s is not None:
            gap_s = now_s - self._last_s
            if gap_s > (self.timeout_s or LONGEST_S):
                self._gaps_s.clear()
                self._known_s = None
            else:
                self._gaps_s.append(gap_s)
        self._last_s = now_s

    def is_alive(self, now_s: float) -> bool:
        """Whether the pad talks as a live one does."""
        timeout_s = self.timeout_s
        return timeout_s is not None and self._last_s is not None and now_s - self._last_s <= timeout_s
