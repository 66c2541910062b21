"""Tones as samples: signed 16 bits, one channel. Pure."""

import numpy as np

RATE_HZ = 22050


def samples(tones: tuple[tuple[float, float], ...]) -> bytes:
    """Tones as (hertz, seconds), one after the other, without clicks at their ends."""
    parts = []
    for pitch_hz, length_s in tones:
        time_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
        edge = np.clip(np.minimum(time_s, length_s - time_s) / 0.01, 0.0, 1.0)
        parts.append(0.4 * edge * np.sin(2 * np.pi * pitch_hz * time_s))
    return (np.concatenate(parts) * 32767).astype(np.int16).tobytes()
