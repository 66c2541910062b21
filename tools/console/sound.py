"""Two sounds that are told apart without looking. Pure: samples of signed 16 bits, one channel."""

import numpy as np

from lira.hal.messages import Call

RATE_HZ = 22050
# Attention: one short high tone. Feedback: a falling pair, twice.
ATTENTION = ((880.0, 0.18),)
FEEDBACK = ((523.0, 0.18), (349.0, 0.26), (523.0, 0.18), (349.0, 0.26))
CALLS = {Call.ATTENTION: ATTENTION, Call.FEEDBACK: FEEDBACK}


def samples(tones: tuple[tuple[float, float], ...]) -> bytes:
    """Tones as (hertz, seconds), one after the other, without clicks at their ends."""
    parts = []
    for pitch_hz, length_s in tones:
        time_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
        edge = np.clip(np.minimum(time_s, length_s - time_s) / 0.01, 0.0, 1.0)
        parts.append(0.4 * edge * np.sin(2 * np.pi * pitch_hz * time_s))
    return (np.concatenate(parts) * 32767).astype(np.int16).tobytes()
