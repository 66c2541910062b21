"""A label as the learner gets it, and its mirror image."""

from dataclasses import dataclass, replace

from lira.fusion.preprocess import Features
from lira.hal.messages import Action

REST = 1e-6  # an action within this of zero is none


@dataclass(frozen=True, slots=True)
class Label:
    """What to do on what was seen. `source` is the driver who gave it, `weight` scales its squared error."""

    features: Features
    action: Action
    source: str
    weight: float = 1.0


def is_rest(action: Action) -> bool:
    """Whether nothing is done."""
    return max(map(abs, action)) <= REST


def mirror(label: Label) -> Label:
    """Exchange left and right in what is seen, and turn the other way."""
    linear, angular = label.action
    return replace(label, features=label.features.mirrored(), action=(linear, -angular))
