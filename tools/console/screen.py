"""Whether there is a screen, and how large the window begins."""

from lira.hal.errors import ConfigError

NO_SCREEN = frozenset({"offscreen", "dummy", "evdev"})  # drivers that SDL takes where nobody can see anything
SMALLEST = (800, 480)


def check_screen(driver: str, wanted: str | None) -> None:
    """Raise `ConfigError` where SDL found no screen, unless its user `wanted` that driver."""
    if driver in NO_SCREEN and driver != wanted:
        raise ConfigError(
            "there is no screen to show the console on", "Look at it in a browser, here or on another machine: lira web"
        )


def window_size(size: tuple[int, int], desktop: tuple[int, int]) -> tuple[int, int]:
    """How large the window begins: the console's own size, or what of the desktop it fits into."""
    scale = min(1.0, desktop[0] / size[0], desktop[1] / size[1])
    return round(size[0] * scale), round(size[1] * scale)
