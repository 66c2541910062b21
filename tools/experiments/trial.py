"""One trial: one method taught on one layout by one teacher, from scratch to convergence or its cap."""

import os
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
from fusion.record import LapRecord, Record, ResultRecord
from fusion.session import Session
from fusion.trainer import InlineTrainer
from hal.errors import StorageError
from hal.governed import GovernedRobot
from hal.messages import Action
from hal.profile import load_profile
from sim_backend.catalogue import load_world
from sim_backend.twin import Twin
from tools.assembly import apprentice, lap, teacher

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
    laps: int = 12
    all_laps: bool = False  # go on after the novice has passed
    unseen: int = 3
    max_linear_m_s: float = 1.0

    @property
    def file(self) -> str:
        """Name of the file that keeps its outcome."""
        return f"{Path(self.world).stem}-{self.method.name}-{self.teacher}-{self.seed}.json"


class Outcome(msgspec.Struct, frozen=True):
    """What came of a trial. `laps` are all laps in order; a run that did not converge is censored, not dropped."""

    trial: Trial
    laps: tuple[LapRecord, ...]
    result: ResultRecord

    def after(self, lap_number: int) -> LapRecord:
        """Totals after a training lap (the last one if there were fewer)."""
        return [each for each in self.laps if each.phase == "train"][:lap_number][-1]


def run_trial(trial: Trial, folder: Path) -> Outcome:
    """Run a trial, or read its outcome if the folder has it: what was interrupted goes on where it stopped."""
    path = folder / trial.file
    if path.exists():
        kept = read_outcome(path)
        if kept.trial == trial:
            return kept
    outcome = play(trial)
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(msgspec.json.encode(outcome))
        draft.replace(path)
    except OSError as error:
        raise StorageError(
            f"cannot write {path}: {error.strerror}", "Free some space or choose another folder."
        ) from error
    return outcome


def read_outcome(path: Path) -> Outcome:
    """Read what `run_trial` wrote. Raises `StorageError`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Outcome)
    except (OSError, msgspec.MsgspecError) as error:
        raise StorageError(
            f"{path} is not the outcome of a trial: {error}", "Delete it to run the trial again."
        ) from error


def play(trial: Trial) -> Outcome:
    """Run a trial in process, on one thread: its outcome does not depend on what runs beside it."""
    import torch

    torch.set_num_threads(1)
    profile, world = load_profile("thesis-sim"), load_world(trial.world)
    base = msgspec.structs.replace(profile.base, max_linear_m_s=trial.max_linear_m_s)
    profile = msgspec.structs.replace(profile, base=base)
    laps: list[LapRecord] = []

    def keep(record: Record) -> None:
        if isinstance(record, LapRecord):
            laps.append(record)

    twin = Twin(profile, world, layout=trial.seed, seed=trial.seed, renderer="tiny")
    robot = GovernedRobot(twin)
    robot.open()
    method = apprentice(trial.method.lira, profile, trial.seed, InlineTrainer, trial.method.learning)
    try:
        if trial.method.warm:
            warm_up(method.novice)
        loop = ControlLoop(robot, truth=twin.state)
        session = Session(robot, twin, loop, Journal(write=keep), method)
        loop.arm()
        hand = teacher(trial.teacher, profile, world, trial.seed, trial.seed)
        converged = session.teach([lap(profile, world, trial.seed)], hand, trial.laps, all_laps=trial.all_laps)
        session.show([lap(profile, world, UNSEEN + trial.seed * trial.unseen + k) for k in range(trial.unseen)])
        return Outcome(trial, tuple(laps), session.result(converged))
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

    profile = load_profile("thesis-sim")
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
