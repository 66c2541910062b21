"""The fusion service on a robot without an arena: it drives, and learns from whoever takes control.

Nothing here re-arms a robot that stopped by itself: a person does that, with the gamepad, by a request or by starting
anew.
"""

from collections.abc import Callable
from threading import Event

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import OperatorService
from lira.hal.messages import Phase, Reason

REARM = "press and release the dead-man (the console's space bar is one), or start lira fusion again"
STOPPED = {
    Reason.NO_COMMAND: "no command reaches it; look whether it still runs",
    Reason.STALE: f"its commands came too late; {REARM}",
    Reason.NEUTRAL_FIRST: f"it waits for a neutral command; {REARM}",
    Reason.REFUSED: f"it refused a command; {REARM}",
    Reason.OBSTACLE: "something is in the way, or the lidar does not say",
    Reason.ESTOP: f"the emergency stop is pressed; release it, then {REARM}",
}


def serve(
    loop: ControlLoop,
    method: Method,
    journal: Journal,
    stop: Event,
    say: Callable[[str], None],
    training_steps: Callable[[], int] = lambda: 0,
    *,
    operator_service: OperatorService | None = None,
    layout: int = 0,
) -> None:
    """Run the control loop until `stop` is set; `operator_service` answers what a person asks between two steps.

    `say` gets a line whenever what holds the robot changes.
    """
    said: Reason | None = Reason.OK
    while not stop.is_set():
        if loop.restarted():
            # Nothing of what was before belongs to what comes.
            method.reset()
            journal.ledger.new_episode()
            say(f"the robot was started anew; what was learned goes on. It stands: {REARM}")
        if operator_service is not None:
            operator_service.serve()
            if operator_service.paused:
                loop.stand()
                continue
        step = loop.step(method)
        reason = None if step is None else step.applied.reason
        if reason is not said:
            why = loop.trouble if reason is None else STOPPED.get(reason)
            say("driving" if why is None else f"standing still: {why}")
            said = reason
        if step is not None:
            episode = 0 if operator_service is None else operator_service.episode
            journal.note(step, phase=Phase.TRAIN, lap=episode, layout=layout, training_steps=training_steps())
