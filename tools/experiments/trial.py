"""One trial: one method taught on one layout by one teacher, from scratch to convergence or its cap."""

import hashlib
from functools import cache
from pathlib import Path

import msgspec

from fusion.control import ControlLoop
from fusion.journal import Journal
from fusion.learner import Label
from fusion.lira import LiraSettings
from fusion.method import Alone
from fusion.novice import LearningSettings, Novice, is_redundant
from fusion.preprocess import Features
from fusion.record import LapRecord, ResultRecord
from fusion.session import Session
from fusion.teacher import SKILLED, TeacherSettings
from fusion.trainer import InlineTrainer
from hal.governed import GovernedRobot
from hal.messages import Action
from hal.profile import load_profile
from sim_backend.catalogue import load_world
from sim_backend.twin import Twin
from tools.assembly import apprentice, lap, teacher
from tools.experiments.notes import Notes, Track

PROFILE = "thesis-sim"
UNSEEN = 1000  # layouts from here on belong to nobody's training
WARM_WORLD, WARM_STEPS = "line", 250


class Method(msgspec.Struct, frozen=True):
    """A row of a table: LIRA-SPF with these settings or, without, HG-DAgger.

    `warm` gives the novice, before anybody teaches it, what the camera expert does on the empty line: the fair
    baseline, since it may use the same experts.
    """

    name: str
    lira: LiraSettings | None = None
    learning: LearningSettings = LearningSettings()
    warm: bool = False


class Trial(msgspec.Struct, frozen=True):
    """What is run. Trials with one seed share layout and teacher stream, whatever the method."""

    method: Method
    world: str
    seed: int
    teacher: str = "scripted"
    skill: TeacherSettings = SKILLED  # the teacher's, of which `teacher` is the name
    laps: int = 12
    all_laps: bool = False  # go on after the novice has passed
    unseen: int = 3
    max_linear_m_s: float = 1.0

    @property
    def file(self) -> str:
        """Name of the file that keeps its outcome: readable, and different for whatever is set differently."""
        digest = hashlib.sha256(msgspec.json.encode(self)).hexdigest()[:8]
        return f"{Path(self.world).stem}-{self.method.name}-{self.teacher}-{self.seed}-{digest}.json"


class Outcome(msgspec.Struct, frozen=True):
    """What came of a trial. `laps` are all laps in order; a run that did not converge is censored, not dropped.

    `labels` holds the stored labels' actions by source, as in `Account`. `tracks` are those of the first training lap
    and of everything from the last one on. `fingerprint` says with which code and experts it was played.
    """

    trial: Trial
    laps: tuple[LapRecord, ...]
    result: ResultRecord
    labels: dict[str, tuple[Action, ...]]
    tracks: tuple[Track, ...]
    fingerprint: str = ""

    def after(self, lap_number: int) -> LapRecord:
        """Totals after a training lap (the last one if there were fewer)."""
        return [each for each in self.laps if each.phase == "train"][:lap_number][-1]


def play(trial: Trial) -> Outcome:
    """Run a trial in process, on one thread: its outcome does not depend on what runs beside it."""
    import torch

    torch.set_num_threads(1)
    profile, world = load_profile(PROFILE), load_world(trial.world)
    base = msgspec.structs.replace(profile.base, max_linear_m_s=trial.max_linear_m_s)
    profile = msgspec.structs.replace(profile, base=base)
    notes = Notes()
    twin = Twin(profile, world, layout=trial.seed, seed=trial.seed, renderer="tiny")
    robot = GovernedRobot(twin)
    robot.open()
    method = apprentice(trial.method.lira, profile, trial.seed, InlineTrainer, trial.method.learning)
    try:
        if trial.method.warm:
            warm_up(method.novice)
        loop = ControlLoop(robot, truth=twin.state)
        session = Session(robot, twin, loop, Journal(keep=notes.label, write=notes.record), method)
        loop.arm()
        hand = teacher(trial.skill, profile, world, trial.seed, trial.seed)
        converged = session.teach([lap(profile, world, trial.seed)], hand, trial.laps, all_laps=trial.all_laps)
        session.show([lap(profile, world, UNSEEN + trial.seed * trial.unseen + k) for k in range(trial.unseen)])
        return Outcome(trial, tuple(notes.laps), session.result(converged), notes.labels, notes.tracks)
    finally:
        method.novice.close()
        robot.close()


def warm_up(novice: Novice) -> None:
    """Store the camera expert's labels of a drive along the empty line, without the redundant ones, and train."""
    threshold = novice.settings.redundancy * novice.settings.action_range
    for now_s, (features, action) in enumerate(camera_drive()):
        if not is_redundant(action, novice.act(features), threshold):
            novice.remember(Label(features.scan, features.image, action, "camera"))
        novice.update(float(now_s))


@cache
def camera_drive() -> list[tuple[Features, Action]]:
    """What the camera expert sees and does on its own line."""
    from fusion.experts import load_expert

    profile = load_profile(PROFILE)
    expert = load_expert("camera-expert", profile)
    robot = GovernedRobot(Twin(profile, WARM_WORLD, renderer="tiny"))
    robot.open()
    try:
        loop = ControlLoop(robot)
        loop.arm()
        steps = [loop.step(Alone("camera", expert.act)) for _ in range(WARM_STEPS)]
    finally:
        robot.close()
    return [(step.proposal.features, step.proposal.choice.action) for step in steps if step is not None]
