"""A warm start: before any human teaches it, the novice learns what the experts do on their own training courses."""

from collections.abc import Sequence
from functools import cache

from fusion.control import ControlLoop
from fusion.curriculum import curriculum
from fusion.experts import load_expert
from fusion.learner import Label
from fusion.method import Alone
from fusion.novice import Novice, is_redundant
from fusion.preprocess import Features
from fusion.presets import Sensor
from fusion.tasks import DEFAULT, TASKS
from hal.governed import GovernedRobot
from hal.messages import Action, Episode
from hal.profile import RobotProfile
from sim_backend.catalogue import load_world
from sim_backend.twin import Twin

STEPS = 250  # of each expert


def warm_up(novice: Novice, names: Sequence[Sensor], profile: RobotProfile, pair: str) -> None:
    """Store these experts' own labels, in turns, without the redundant ones, and train as on any label."""
    threshold = novice.settings.redundancy * novice.settings.action_range
    drives = [[(name, *seen) for seen in own_drive(name, profile, pair)] for name in names]
    turns = [step for turn in zip(*drives, strict=True) for step in turn]
    for now_s, (name, features, action) in enumerate(turns):
        if not is_redundant(action, novice.act(features), threshold):
            novice.remember(Label(features.scan, features.image, action, name))
        novice.update(float(now_s))
    novice.catch_up()


@cache
def own_drive(name: Sensor, profile: RobotProfile, pair: str) -> tuple[tuple[Features, Action], ...]:
    """What an expert sees and does where it was trained; a new layout begins where the last one ended."""
    expert = load_expert(f"{name}-expert", profile, pair)
    twin = Twin(profile, load_world(curriculum(name, pair if pair in TASKS else DEFAULT).world), renderer="tiny")
    robot = GovernedRobot(twin)
    robot.open()
    seen: list[tuple[Features, Action]] = []
    layout = 0
    try:
        loop = ControlLoop(robot)
        loop.arm()
        while len(seen) < STEPS:
            step = loop.step(Alone(name, expert.act))
            if step is not None:
                seen.append((step.proposal.features, step.proposal.choice.action))
            state = twin.state()
            if state.collided or state.lost or state.finished:
                layout += 1
                twin.reset(Episode(layout))
    finally:
        robot.close()
    return tuple(seen)
