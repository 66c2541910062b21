"""What calls feel like. Pure: a pattern is a list of (strength, seconds), strength in [0, 1]."""

from lira.hal.messages import JoyFeedback
from lira.tools.operator.situation import Urgency

Pattern = tuple[tuple[float, float], ...]

# Attention: two short taps. Feedback ("you decide"): three long, strong ones.
ATTENTION: Pattern = ((0.5, 0.12), (0.0, 0.10), (0.5, 0.12))
FEEDBACK: Pattern = ((1.0, 0.35), (0.0, 0.12), (1.0, 0.35), (0.0, 0.12), (1.0, 0.35))
# It stands and needs you: five strong taps.
NEED: Pattern = ((1.0, 0.12), (0.0, 0.12)) * 4 + ((1.0, 0.12),)
# A request was taken: one tap.
TAKEN: Pattern = ((0.5, 0.08),)
PATTERNS = {Urgency.WATCH: ATTENTION, Urgency.ASK: FEEDBACK, Urgency.NEED: NEED}

# `JoyFeedback.id` of our patterns; any other id is a plain rumble of the message's intensity.
ATTENTION_ID, FEEDBACK_ID = 10, 11
PLAIN_S = 0.3


def pattern_of(feedback: JoyFeedback) -> Pattern:
    """What a message on `joy/feedback` feels like; nothing for what is no rumble."""
    if feedback.type != JoyFeedback.TYPE_RUMBLE:
        return ()
    if feedback.id == ATTENTION_ID:
        return ATTENTION
    if feedback.id == FEEDBACK_ID:
        return FEEDBACK
    return ((min(1.0, max(0.0, feedback.intensity)), PLAIN_S),)


class Rumble:
    """Plays one pattern at a time. `strength` says what the motors should do now, for certain 0 at the end."""

    def __init__(self) -> None:
        self._pattern: Pattern = ()
        self._began_s = 0.0

    def play(self, pattern: Pattern, now_s: float) -> None:
        """Begin a pattern; one that already plays goes on."""
        if pattern != self._pattern or self.strength(now_s) is None:
            self._pattern, self._began_s = pattern, now_s

    def strength(self, now_s: float) -> float | None:
        """Strength now; None when nothing plays."""
        left_s = now_s - self._began_s
        for strength, length_s in self._pattern:
            if left_s < length_s:
                return strength
            left_s -= length_s
        return None
