"""What a lap is called, the same while a run goes on and in its report."""

from lira.hal.messages import Phase

PHASES = {Phase.TRAIN: "training lap", Phase.PROVE: "proving run", Phase.UNSEEN: "unseen layout"}


def lap_name(phase: Phase, lap: int, layout: int, turn: int = 1) -> str:
    """A training lap by its number, a proving run by that and which it is after that lap (`turn`), others by layout."""
    number = {Phase.PROVE: f"{lap}.{turn}", Phase.UNSEEN: str(layout)}.get(phase, str(lap))
    return f"{PHASES.get(phase, phase)} {number}"
