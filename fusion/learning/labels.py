"""A label as the learner gets it, and its mirror image."""

from dataclasses import dataclass, replace

import numpy as np

from lira.hal.messages import Action, FloatArray

REST = 1e-6  # an action within this of zero is none


@dataclass(frozen=True, slots=True)
class Label:
    """What to do on what was seen. `source` is "human" or an expert's name, `weight` scales its squared error."""

    scan: FloatArray
    image: FloatArray
    action: Action
    source: str
    weight: float = 1.0


def is_rest(action: Action) -> bool:
    """Whether nothing is done."""
    return max(map(abs, action)) <= REST


def mirror(label: Label) -> Label:
    """Exchange left and right: beams and columns in reverse, the turn negated."""
    linear, angular = label.action
    return replace(
        label,
        scan=np.ascontiguousarray(label.scan[::-1]),
        image=np.ascontiguousarray(label.image[:, ::-1]),
        action=(linear, -angular),
    )
