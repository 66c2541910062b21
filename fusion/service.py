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
from lira.hal.messages import STOP, Applied, Phase, Reason


def reason_alone(applied: Applied) -> str:
    """Why the robot stands, in the governor's own word."""
    return applied.reason


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
    explain: Callable[[Applied], str] = reason_alone,
    is_attended: Callable[[], bool] | None = None,
    alive: Callable[[], None] = lambda: None,
) -> None:
    """Run the control loop until `stop` is set; `operator_service` answers what a person asks between two steps.

    Where `is_attended` is given, a method that begins by itself stands until it is true: a hand is on the controls.

    `say` gets a line whenever what holds the robot changes; `explain` puts into words why it stands and what to do.
    `alive` is called with every turn of the loop.
    """
    said: Reason | None = Reason.OK
    stands = is_attended is not None and method.begins_alone
    while not stop.is_set():
        alive()
        if loop.restarted():
            # Nothing of what was before belongs to what comes.
            method.reset()
            journal.ledger.new_episode()
            held = Applied(STOP, 0.0, reason=Reason.NEUTRAL_FIRST)
            say(f"the robot was started anew; what was learned goes on. {explain(held)}")
        if operator_service is not None:
            operator_service.serve()
            if operator_service.paused:
                loop.stand()
                continue
        if is_attended is not None and stands:
            stands = not is_attended()
            loop.stand()
            continue
        step = loop.step(method)
        reason = None if step is None else step.applied.reason
        if reason is not said:
            if step is None:
                say(f"standing still: {loop.trouble}")
            else:
                say("driving" if reason is Reason.OK else explain(step.applied))
            said = reason
        if step is not None:
            episode = 0 if operator_service is None else operator_service.episode
            journal.note(step, phase=Phase.TRAIN, lap=episode, layout=layout, training_steps=training_steps())
