"""What a page is told once: words, sounds, what shakes how, the signs, and the map."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from lira.hal.bus.services import Info
from lira.hal.errors import ConfigError
from lira.tools.joystick.rumble import PATTERNS
from lira.tools.operator.situation import CORNERS
from lira.tools.operator.tones import TONES
from lira.tools.web.floor import floor_of

WORDS = Path(__file__).parent / "words"


def settings_of(info: Info, robot: str, usual: int, language: str, layout: int | None = None) -> dict[str, Any]:
    """Everything in one table. Times of what shakes are in milliseconds, on and off in turn, as browsers have it."""
    features = info.profile.features
    return {
        "robot": robot,
        "language": language,
        "words": labels(language),
        "tones": {str(urgency): tones for urgency, tones in TONES.items()},
        "shakes": {str(urgency): [round(1e3 * length_s) for _, length_s in way] for urgency, way in PATTERNS.items()},
        "corners": {str(urgency): corners for urgency, corners in CORNERS.items()},
        "fov_rad": features.fov_rad,
        "max_range_m": features.max_range_m,
        "floor": floor_of(info, usual if layout is None else layout),
    }


@cache
def labels(language: str) -> dict[str, str]:
    """What is written on the page itself. Raises `ConfigError` if there is no such file."""
    path = WORDS / f"{language}.toml"
    if not path.is_file():
        raise ConfigError(f"the page has no words in '{language}'", f"Write {path}, as en.toml is.")
    return tomllib.loads(path.read_text(encoding="utf-8"))
