"""Whether the board is there, by what it says: pure, the time comes in."""

from enum import Enum, auto

SILENCE_S = 0.2  # some 90 frames come in a second: it is gone, resets, or its line is cut
ZEROS_S = 0.2  # four zeros; a board that boots keeps what comes, so the last of it has to be zero
SETTLE_S = 0.05  # announcements come in a burst, and once for each request that has waited in the board's port


class State(Enum):
    """What may be written to the board."""

    LEARNING = auto()  # requests for topics, nothing else: it has announced nothing since it was lost
    SPEAKING = auto()  # everything
    SILENT = auto()  # zeros


class Contact:
    """Follows one board from its announcements into its silence, and out of it."""

    def __init__(self, now_s: float) -> None:
        self.state = State.LEARNING
        self._read_s = self._announced_s = now_s

    def step(self, now_s: float, *, read: bool, announced: bool, ready: bool) -> State:
        """Return the state now.

        `read`: there was a reading on a topic that the board announced. A log or a question for the time does not
        count, a board that has just booted has them, too. `announced`: it told of a topic, which it does not do
        unasked: it begins anew. `ready`: it has told of all that is needed.
        """
        if read:
            self._read_s = now_s
        if announced:
            self._announced_s = now_s
            self.state = State.LEARNING
        if self.state is State.LEARNING:
            if ready and now_s - self._announced_s >= SETTLE_S:
                self.state, self._read_s = State.SPEAKING, now_s
            return self.state
        silent_s = now_s - self._read_s
        if silent_s > SILENCE_S + ZEROS_S:
            self.state = State.LEARNING
        else:
            self.state = State.SILENT if silent_s > SILENCE_S else State.SPEAKING
        return self.state
