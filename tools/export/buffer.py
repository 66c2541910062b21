"""Which steps the learner learns from, by its log of labels: also those that it stored later, or gave up. Pure."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from lira.fusion.log.label_file import Demonstration
from lira.hal.messages import Action
from lira.tools.export.steps import ExportStep

Key = tuple[int, str, Action]


def in_buffer(steps: Iterable[ExportStep], labels: Iterable[Demonstration]) -> Iterator[ExportStep]:
    """Yield the steps with what the log says of each.

    A step and its label have the same observation, the same driver and the same action of the novice's; times are not
    compared, since a recording and a log may have different clocks.
    """
    stored: set[Key] = {(label.observation, label.source, label.novice) for label in labels if label.stored}
    for step in steps:
        decision = step.decision
        yield replace(step, in_buffer=(decision.observation, decision.driver, decision.novice) in stored)
