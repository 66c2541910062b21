"""What each urgency sounds like: tones of (hertz, seconds), told apart without looking; 0 Hz is silence."""

from lira.tools.operator.situation import Urgency

# Watch: one short high tone. Your decision: a falling pair, twice. It needs you: three low ones. Alarm: up and down.
TONES = {
    Urgency.WATCH: ((880.0, 0.18),),
    Urgency.ASK: ((523.0, 0.18), (349.0, 0.26), (523.0, 0.18), (349.0, 0.26)),
    Urgency.NEED: ((262.0, 0.2), (0.0, 0.1), (262.0, 0.2), (0.0, 0.1), (262.0, 0.4)),
    Urgency.ALARM: ((988.0, 0.15), (740.0, 0.15), (988.0, 0.15), (740.0, 0.15)),
}
