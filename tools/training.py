"""Training an expert in process: the same loop, teacher and session as over the bus."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from fusion.checkpoint import Checkpoint, save_checkpoint
from fusion.control import ControlLoop
from fusion.curriculum import CURRICULA
from fusion.hg_dagger import HgDagger
from fusion.journal import Journal
from fusion.learner import Learner
from fusion.method import Alone
from fusion.networks import CameraNet, LidarNet, Network
from fusion.novice import LearningSettings, Novice
from fusion.record import Record
from fusion.session import Session
from fusion.teacher import ScriptedTeacher
from fusion.trainer import InlineTrainer
from hal.governed import GovernedRobot
from hal.messages import Action
from hal.profile import RobotProfile
from sim_backend.catalogue import load_world
from sim_backend.foresight import Foresight
from sim_backend.twin import Twin
from tools.progress import Progress

CRUISE_STEPS = 25


def train_expert(kind: Literal["camera", "lidar"], profile: RobotProfile, seed: int, path: Path, command: str) -> bool:
    """Train the camera or lidar expert and save it to `path` if it passes. Returns whether it did."""
    torch.set_num_threads(1)
    curriculum = CURRICULA[kind]
    world = load_world(curriculum.world)
    shape = profile.features
    network: Network
    network = CameraNet(shape.filters, seed=seed) if kind == "camera" else LidarNet(shape.bins, seed=seed)
    novice = Novice(network, InlineTrainer(Learner(network, seed=seed, frozen_trunks=False)), LearningSettings())
    progress = Progress()

    def show(record: Record) -> None:
        line = progress.note(record)
        if line is not None:
            print(line, flush=True)

    twin = Twin(profile, world, seed=seed)
    robot = GovernedRobot(twin)
    robot.open()
    try:
        loop = ControlLoop(robot, truth=twin.state)
        teacher = ScriptedTeacher(Foresight(profile, world), profile, curriculum.teacher, seed)
        session = Session(robot, twin, loop, Journal(write=show), HgDagger(novice))
        loop.arm()
        passed = session.teach(curriculum.drives, teacher, curriculum.laps)
    finally:
        robot.close()
    if passed:
        cruise = measure_cruise(network, profile)
        about = Checkpoint(kind, shape.bins, shape.filters, profile.name, cruise, command, seed)
        save_checkpoint(path, network, replace(about, labels=novice.stored, training_steps=novice.training_steps))
        print(f"{kind} expert: {novice.stored} labels, {novice.training_steps} training steps, saved to {path}")
    return passed


def measure_cruise(network: Network, profile: RobotProfile) -> Action:
    """Median action on an empty straight course: what the expert does while its sensor shows nothing to react to."""
    robot = GovernedRobot(Twin(profile, load_world("straight")))
    robot.open()
    try:
        loop = ControlLoop(robot)
        loop.arm()
        alone = Alone("novice", lambda features: network.act(features.scan, features.image))
        steps = [loop.step(alone) for _ in range(CRUISE_STEPS)]
    finally:
        robot.close()
    actions = [step.proposal.choice.action for step in steps if step is not None]
    linear, angular = np.median(np.asarray(actions), axis=0)
    return float(linear), float(angular)
