"""The console's window: look, draw, sound, keyboard, keep time. At most 30 pictures a second; late ones are dropped."""

import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import pygame

from lira.hal.errors import StorageError
from lira.hal.messages import Request
from lira.tools.console import sound
from lira.tools.console.draw import SIZE, draw
from lira.tools.console.keyboard import keyboard_mapping, pad_of
from lira.tools.console.screen import check_screen, window_size
from lira.tools.joystick.axes import PadState
from lira.tools.joystick.client import TeleopClient
from lira.tools.joystick.deadman import Hand, State
from lira.tools.joystick.requests import RequestButtons
from lira.tools.operator.situation import Urgency
from lira.tools.operator.tones import TONES
from lira.tools.operator.view import View
from lira.tools.operator.voice import speak

FPS = 30.0
KEYS = {
    pygame.K_SPACE: "space",
    pygame.K_LSHIFT: "left shift",
    pygame.K_ESCAPE: "escape",
    pygame.K_F1: "f1",
    pygame.K_UP: "up",
    pygame.K_DOWN: "down",
    pygame.K_LEFT: "left",
    pygame.K_RIGHT: "right",
    pygame.K_p: "p",
    pygame.K_s: "s",
    pygame.K_r: "r",
    pygame.K_v: "v",
    pygame.K_u: "u",
    pygame.K_1: "1",
    pygame.K_2: "2",
    pygame.K_3: "3",
    pygame.K_4: "4",
}


class Keyboard:
    """The keyboard's hand on the controls, and what it asks; a window without the focus is a pad that is lost.

    `unanswered` is the newest request if nobody answered it; `confirmed` whether the robot says that the emergency stop
    holds which was pressed here.
    """

    def __init__(self, client: TeleopClient) -> None:
        self._client = client
        self._hand = Hand(keyboard_mapping())
        self._buttons = RequestButtons(keyboard_mapping())
        self.unanswered: Request | None = None

    @property
    def state(self) -> State:
        """Where the hand is."""
        return self._hand.state

    @property
    def confirmed(self) -> bool:
        """Whether the robot has acknowledged the emergency stop."""
        return self._client.confirmed

    def update(self, pressed: frozenset[str] | None) -> None:
        """Send what the keys order; None without the focus."""
        self._client.listen()
        now_s = time.monotonic()
        pad = None if pressed is None else pad_of(pressed)
        order = self._hand.update(pad, now_s)
        if order.estop is not None:
            self._client.estop(order.estop)
        if order.action is not None:
            self._client.drive(order.action, order.released, now_s)
        self._ask(pad, now_s)

    def _ask(self, pad: PadState | None, now_s: float) -> None:
        self._client.decisions()
        if self._client.answers():
            self.unanswered = None
        for request in self._buttons.update(pad, now_s, paused=self._client.paused, experts=self._client.experts):
            self._client.ask(request, now_s)
            self.unanswered = None
        self.unanswered = self._client.unanswered(now_s) or self.unanswered


def save_picture(view: View, path: str) -> None:
    """Draw one view without a screen and write it. Raises `StorageError` if it cannot be written."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    pygame.font.init()
    surface = pygame.Surface(SIZE)
    draw(surface, view)
    try:
        pygame.image.save(surface, path)
    except (pygame.error, OSError) as error:
        raise StorageError(f"cannot write {path}", "Name a .png file in a folder that may be written.") from error


def show(look: Callable[[], View], keyboard: Keyboard | None, stop: threading.Event) -> None:
    """Show until the window is closed or `stop` is set."""
    pygame.display.init()
    pygame.font.init()
    try:
        check_screen(pygame.display.get_driver(), os.environ.get("SDL_VIDEODRIVER"))
        sounds = load_sounds()
        desktop = pygame.display.get_desktop_sizes()[0]
        screen = pygame.display.set_mode(window_size(SIZE, desktop), pygame.RESIZABLE)
        pygame.display.set_caption("lira console")
        pressed: frozenset[str] = frozenset()
        loud, due_s = Urgency.CALM, time.monotonic()
        while not stop.is_set():
            for event in pygame.event.get():
                if event.type == pygame.QUIT:
                    return
                if event.type in (pygame.KEYDOWN, pygame.KEYUP) and event.key in KEYS:
                    key = frozenset((KEYS[event.key],))
                    pressed = pressed | key if event.type == pygame.KEYDOWN else pressed - key
                    if keyboard is not None:  # a press and its end may come within one picture
                        keyboard.update(pressed)
            focused = pygame.key.get_focused()
            pressed = pressed if focused else frozenset()
            if keyboard is not None:
                keyboard.update(pressed if focused else None)
            view = look()
            if keyboard is not None:
                view = replace(view, hand=keyboard.state, unanswered=keyboard.unanswered, confirmed=keyboard.confirmed)
            urgency = speak(view).urgency
            if urgency is not loud and urgency in sounds:
                sounds[urgency].play()
            loud = urgency
            draw(screen, view)
            pygame.display.flip()
            due_s = max(due_s + 1.0 / FPS, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))
    finally:
        pygame.quit()


def load_sounds() -> dict[Urgency, pygame.mixer.Sound]:
    """What each urgency sounds like; none on a machine without a loudspeaker."""
    try:
        pygame.mixer.init(frequency=sound.RATE_HZ, size=-16, channels=1)
    except pygame.error:
        return {}
    return {urgency: pygame.mixer.Sound(buffer=sound.samples(tones)) for urgency, tones in TONES.items()}
