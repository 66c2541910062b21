"""How late the pictures of a stream are, by the stream's own clock against their arrival. Pure."""

DRIFT = 5e-4  # of two clocks, at most: what is later than that is late
FALL_S = 0.03  # a lag that falls by so much within
SETTLE_S = 0.3  # so long is that of a queue which is being emptied
LATE_S = 0.3  # what is later is not shown


class StreamClock:
    """Follows one stream. The least lag ever, arrival less the stream's own time, is that of a fresh picture.

    Nobody knows how old a picture was that came with the least lag; what is measured is what comes on top of it: that
    of pictures that wait in a queue, here, in the network or in the camera. At the start a stream brings what has
    waited there, so the lag has to have settled before anything counts.
    """

    def __init__(self) -> None:
        self._least_s: float | None = None
        self._settling_s = self._settling_from_s = 0.0  # the least lag when it last fell, and when that was
        self._arrived_s = self._stream_s = 0.0

    def delay_s(self, arrived_s: float, stream_s: float) -> float | None:
        """Return how late a picture is that came at `arrived_s`; None while that cannot be told yet."""
        lag_s = arrived_s - stream_s
        if self._least_s is None or stream_s < self._stream_s:  # time never runs back: this is another clock
            self._least_s = self._settling_s = lag_s
            self._settling_from_s = arrived_s
        else:
            self._least_s = min(lag_s, self._least_s + DRIFT * (arrived_s - self._arrived_s))
        self._arrived_s, self._stream_s = arrived_s, stream_s
        if self._least_s < self._settling_s - FALL_S:
            self._settling_s, self._settling_from_s = self._least_s, arrived_s
        if arrived_s - self._settling_from_s < SETTLE_S:
            return None
        return lag_s - self._least_s
