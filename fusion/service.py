"""The fusion service on a robot without an arena: it drives, and learns from whoever takes the wheel.

Nothing here re-arms a robot that stopped by itself: a person does that, with the gamepad or by starting anew.
"""

from collections.abc import Callable
from threading import Event

from fusion.control import ControlLoop
from fusion.journal import Journal
from fusion.method import Method
from hal.messages import Reason

STOPPED = {
    Reason.STALE: "its commands came too late",
    Reason.NEUTRAL_FIRST: "it waits for a neutral command",
    Reason.REFUSED: "it refused a command",
}


def serve(
    loop: ControlLoop,
    method: Method,
    journal: Journal,
    stop: Event,
    say: Callable[[str], None],
    training_steps: Callable[[], int] = lambda: 0,
) -> None:
    """Run the control loop until `stop` is set. `say` gets a line whenever what holds the robot changes."""
    said = ""
    while not stop.is_set():
        step = loop.step(method)
        if step is None:
            line = "a sensor is stale or unusable: standing still"
        elif step.applied.reason in STOPPED:
            line = f"the robot stands: {STOPPED[step.applied.reason]}; press and release the dead-man, or start anew"
        else:
            line = ""
        if line != said and (line or said):
            say(line or "driving again")
        said = line
        if step is not None:
            journal.note(step, phase="train", lap=0, layout=0, training_steps=training_steps())
