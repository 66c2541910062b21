"""The window's size, whatever it is: the console is drawn in its own size and fitted in, whole and in proportion."""

import pygame

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


def fitted(size: tuple[int, int], window: tuple[int, int]) -> pygame.Rect:
    """Where in a window a picture of this size goes: as large as it fits, in the middle."""
    scale = min(window[0] / size[0], window[1] / size[1])
    box = pygame.Rect(0, 0, max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
    box.center = (window[0] // 2, window[1] // 2)
    return box


def show_fitted(screen: pygame.Surface, picture: pygame.Surface) -> None:
    """Put a picture on the screen: whole multiples pixel by pixel, and all else smoothed."""
    box = fitted(picture.get_size(), screen.get_size())
    if box.size == picture.get_size():
        screen.blit(picture, box)
        return
    whole = box.width % picture.get_width() == 0 and box.height % picture.get_height() == 0
    scale = pygame.transform.scale if whole else pygame.transform.smoothscale
    screen.fill((0, 0, 0))
    screen.blit(scale(picture, box.size), box)
