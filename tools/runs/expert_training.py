"""Training an expert in process: the same loop, teacher and session as over the bus."""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from lira.fusion.control import ControlLoop
from lira.fusion.experts.files import experts_of, folder_of, seeded
from lira.fusion.experts.tasks import DEFAULT, TASKS
from lira.fusion.inference.checkpoint import Checkpoint, save_checkpoint
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.learner import Learner
from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.learning.trainer import Beginning, InlineTrainer
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Alone
from lira.fusion.methods.rivals.hg_dagger import HgDagger
from lira.fusion.policies.networks import ExpertNet
from lira.fusion.preprocess import modalities_of
from lira.fusion.teaching.curriculum import Anew, Curriculum, curriculum
from lira.fusion.teaching.session import Same, Session
from lira.fusion.teaching.teacher import ScriptedTeacher
from lira.hal.errors import LiraError
from lira.hal.messages import Action, Driver
from lira.hal.profile import RobotProfile, load_profile
from lira.hal.words import plural
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.foresight import Foresight, with_small_camera
from lira.sim_backend.scenes.opening import quickest
from lira.tools.output.say import say
from lira.tools.runs.progress import telling
from lira.tools.runs.simulated import simulate

BLIND_HZ = 0.01


def train_expert(kind: str, task: str, profile: RobotProfile, seed: int, path: Path, command: str) -> None:
    """Train the expert that a task has for one sensor until it is proven, and save it to `path`.

    Raises `LiraError` if it was not within the laps of its curriculum; nothing is saved then.
    """
    one_thread()
    course = curriculum(kind, task)
    world = load_world(course.world)
    sees = next(row for row in modalities_of(profile) if row.sensor == kind)
    profile = seeing_only(sees.name, with_small_camera(profile))
    network = ExpertNet(sees.name, sees.shape(profile), profile.features.filters, seed=seed)
    learner = partial(Learner, network, seed=seed, frozen_trunks=False, mirrored=course.mirrored)
    trainer = InlineTrainer(Beginning(network.architecture, learner))
    novice = NetworkNovice(trainer.network, trainer, LearningSettings(labels_per_step=course.labels_per_step))
    with (
        simulate(world, profile, seed=seed, renderer=quickest(world)) as robot,
        closing(ScriptedTeacher(Foresight(profile, world), profile, course.teacher, seed)) as teacher,
    ):
        session = Session(robot, robot.arena, Journal(write=telling(say)), HgDagger(novice))
        proven = session.teach(Anew(course, seed) if course.proofs else Same(course.drives), teacher, course.laps)
    if not proven:
        asked = f"{plural(course.proofs, 'fresh lap')} in a row" if course.proofs else "the lap that was taught"
        what = f"after {plural(course.laps, 'lap')} the {kind} expert of '{task}' does not pass {asked}"
        raise LiraError(f"{what}; nothing was saved", "Try another seed.")
    expert = novice.frozen()
    cruise = measure_cruise(expert, profile, course)
    about = Checkpoint.of(expert, profile.name, command, seed, cruise)
    save_checkpoint(path, expert, replace(about, labels=novice.stored, training_steps=novice.training_steps))
    took = f"{plural(novice.stored, 'label')} learned, {plural(novice.training_steps, 'training step')}"
    print(f"{kind} expert: {took}, saved to {path}")


def provide(pair: str) -> None:
    """Train the experts of a pair named TASK@SEED that are not there yet; others have to be there.

    Raises `LiraError` for an expert that is not proven.
    """
    found = seeded(pair)
    if found is None:
        return
    task, seed = found
    profile = load_profile(TASKS[task].profile)
    for kind in experts_of(profile):
        path = folder_of(pair) / f"{kind}.safetensors"
        if not path.exists():
            train_expert(kind, task, profile, seed, path, command(kind, task, profile, seed))


def command(kind: str, task: str, profile: RobotProfile, seed: int) -> str:
    """Return the words that train an expert."""
    words = "" if task == DEFAULT else f" --task {task}"
    return f"lira train-expert {kind}{words} --profile {profile.name} --seed {seed}"


def seeing_only(name: str, profile: RobotProfile) -> RobotProfile:
    """Return the profile of a robot that learns from one feature: it waits for no pictures that it does not see."""
    features = msgspec.structs.replace(profile.features, inputs=(name,))
    camera = profile.camera if name == "image" else msgspec.structs.replace(profile.camera, rate_hz=BLIND_HZ)
    return msgspec.structs.replace(profile, features=features, camera=camera)


def measure_cruise(network: DrivingNet, profile: RobotProfile, course: Curriculum) -> Action:
    """Median action where the world is straight and empty: what the expert does with nothing to react to."""
    alone = Alone(Driver.NOVICE, network.act)
    with simulate(course.cruise_world, profile) as robot:
        loop = ControlLoop(robot)
        loop.arm()
        steps = [loop.step(alone) for _ in range(course.cruise_steps)]
    actions = [step.proposal.choice.action for step in steps if step is not None]
    linear, angular = np.median(np.asarray(actions), axis=0)
    return float(linear), float(angular)
