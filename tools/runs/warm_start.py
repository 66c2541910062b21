"""A warm start: before any human teaches it, the novice learns what the experts do on their own training courses."""

from collections.abc import Sequence
from functools import cache

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_policy
from lira.fusion.experts.tasks import DEFAULT, TASKS
from lira.fusion.learning.labels import Label
from lira.fusion.learning.novice import Novice, is_redundant
from lira.fusion.methods.base import Alone
from lira.fusion.preprocess import Features
from lira.fusion.teaching.curriculum import curriculum
from lira.hal.messages import Action, Episode
from lira.hal.profile import RobotProfile
from lira.tools.runs.simulated import simulate

STEPS = 250  # of each expert


def warm_up(novice: Novice, names: Sequence[str], profile: RobotProfile, pair: str) -> None:
    """Store these experts' own labels, in turns, without the redundant ones, and train as on any label."""
    threshold = novice.settings.redundancy * novice.settings.action_range
    drives = [[(name, *seen) for seen in own_drive(name, profile, pair)] for name in names]
    turns = [step for turn in zip(*drives, strict=True) for step in turn]
    for now_s, (name, features, action) in enumerate(turns):
        if not is_redundant(action, novice.act(features), threshold):
            novice.remember(Label(features, action, name))
        novice.update(float(now_s))
    novice.catch_up()


@cache
def own_drive(name: str, profile: RobotProfile, pair: str) -> tuple[tuple[Features, Action], ...]:
    """What an expert sees and does where it was trained; a new layout begins where the last one ended."""
    expert = load_policy(f"{name}-expert", profile, pair)
    world = curriculum(name, pair if pair in TASKS else DEFAULT).world
    seen: list[tuple[Features, Action]] = []
    layout = 0
    with simulate(world, profile, renderer="sketch") as robot:
        loop = ControlLoop(robot)
        loop.arm()
        while len(seen) < STEPS:
            step = loop.step(Alone(name, expert.act))
            if step is not None:
                seen.append((step.proposal.features, step.proposal.choice.action))
            state = robot.arena.state()
            if state.collided or state.lost or state.finished:
                layout += 1
                robot.arena.reset(Episode(layout))
    return tuple(seen)
