"""Which line of Algorithm 1 (thesis, section III) decided a step, or what of `plus` did. Pure.

The line numbers are those in `fusion.methods.lira`.
"""

from dataclasses import dataclass

import numpy as np

from lira.fusion.log.method_trace import State
from lira.fusion.methods.lira import LiraSettings
from lira.fusion.methods.plus import PlusSettings
from lira.hal.messages import Action, Call, Driver, ExpertView, Phase
from lira.tools.inquiry.trace import Step
from lira.tools.runs.plan import Recipe

AXES = ("forward", "turn")


@dataclass(frozen=True, slots=True)
class Line:
    """`lines` of Algorithm 1, "" where something else decided, and why those."""

    lines: str
    words: str


def line_of(step: Step, recipe: Recipe | None, novice: State | None) -> Line:
    """Say what decided a step. `recipe` and `novice` (as it was then) are None where they are not known."""
    assert step.decided is not None
    choice, experts = step.decided.choice, step.decided.experts
    plus = recipe.preset.approach if recipe is not None and isinstance(recipe.preset.approach, PlusSettings) else None
    if step.human is not None:
        return Line("7 to 9", "the human gives feedback: what they do is executed, and is the label")
    if step.phase != Phase.TRAIN or not experts:
        return _outside(step)
    if choice.given:
        return Line("", f"the human gave {choice.driver} control: its actions are the labels")
    if plus is not None and novice is not None and novice.labels < (most := plus.filled_by(len(experts))):
        taught = f"{novice.labels} of {most} labels"
        return Line("", f"pre-fill: the experts teach before anybody is asked, {taught} so far")
    if choice.driver == Driver.NOBODY or (novice is not None and novice.steps == 0):
        return Line("", "before the first training step the novice knows nothing: the human is asked to drive")
    return _of_experts(step, settings_of(recipe))


def _outside(step: Step) -> Line:
    assert step.decided is not None
    choice = step.decided.choice
    if choice.driver == Driver.SHIELD:
        return Line("", "the shield turned it away from what the lidar sees")
    if choice.call is Call.FEEDBACK:
        return Line("", "it doubts what it has learned here, and asks")
    if step.phase != Phase.TRAIN:
        return Line("", "the novice drives alone, to show what it has learned")
    return Line("", "this method asks no experts: the novice drives until a human takes over")


def _of_experts(step: Step, settings: LiraSettings | None) -> Line:
    assert step.decided is not None
    choice = step.decided.choice
    active = [expert for expert in step.decided.experts if expert.active]
    if not active:
        return Line("22, 23", "no expert is active: the novice drives, and nothing is learned")
    names = " and ".join(expert.name for expert in active)
    if len(active) == 1 and choice.driver == active[0].name:
        return Line("10 to 13", f"only {names} is active: it drives, its action is the label, the human looks")
    apart = spread(active, settings)
    if choice.driver == Driver.MEAN:
        return Line("14 to 18", f"{names} agree ({apart}): their mean drives, and is the label")
    if choice.driver == Driver.NOVICE and choice.call is Call.FEEDBACK:
        return Line("19 to 21", f"{names} disagree ({apart}): the novice drives slowly, and the human is called")
    if choice.driver == Driver.NOVICE:
        return Line("", f"active: {names}, but the novice is surer of what to do: it drives, and nobody is called")
    return Line("", f"{choice.driver} has priority: the human drove like it")


def spread(active: list[ExpertView], settings: LiraSettings | None) -> str:
    """How far actions lie apart, and by how much they may (eq. 2)."""
    apart = np.ptp(np.array([expert.action for expert in active]), axis=0)
    widest = int(apart.argmax())
    limit = "" if settings is None else f", T is {settings.consensus * settings.action_range:.2f}"
    return f"{AXES[widest]} by {apart[widest]:.2f}{limit}"


def settings_of(recipe: Recipe | None) -> LiraSettings | None:
    """The thresholds of LIRA-SPF, in `plus` too; None for another method."""
    approach = None if recipe is None else recipe.preset.approach
    if isinstance(approach, PlusSettings):
        return approach.lira
    return approach if isinstance(approach, LiraSettings) else None


def activity(expert: ExpertView, threshold: float, settings: LiraSettings | None) -> str:
    """Why an expert is active or not (eq. 1); the threshold is theta times the range of an action."""
    if not expert.active:
        return f"A {expert.activation:.3f}, threshold {threshold:.3f}: inactive"
    if expert.activation > threshold:
        return f"A {expert.activation:.3f} > threshold {threshold:.3f}: active"
    held = "" if settings is None or settings.hold is None else f" by more than {settings.hold:.2f}"
    return f"A {expert.activation:.3f}, but it holds an action away from its cruise{held}: active"


def spoken(action: Action) -> str:
    """An action in two numbers."""
    return f"forward {action[0]:+.2f}, turn {action[1]:+.2f}"
