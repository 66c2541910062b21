"""What is wrong with a robot while it is served: told when it begins, and when it is over."""

import threading
from typing import Protocol, runtime_checkable

LOOK_S = 0.2


@runtime_checkable
class Troubled(Protocol):
    """A robot that says what is wrong with it."""

    def troubles(self) -> dict[str, str]:
        """What is lost, each with its remedy."""


def watch(robot: object, stop: threading.Event) -> None:
    """Tell beside, until `stop`, if the robot is one that says what is wrong with it."""
    if isinstance(robot, Troubled):
        threading.Thread(target=_report, args=(robot, stop), daemon=True, name="status").start()


def _report(robot: Troubled, stop: threading.Event) -> None:
    """Say which device is lost, and when it is back."""
    known: dict[str, str] = {}
    while not stop.wait(LOOK_S):
        troubles = robot.troubles()
        for name in troubles.keys() - known.keys():
            print(f"the robot stands: {troubles[name]}", flush=True)
        for name in known.keys() - troubles.keys():
            print(f"the {name} is back; the robot moves again after a zero command", flush=True)
        known = troubles
