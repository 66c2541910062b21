"""Puts learners together: which networks, which experts, which method, which teacher, which lap."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from lira.fusion.experts.files import SHIPPED
from lira.fusion.experts.load import as_expert, load_network
from lira.fusion.experts.tasks import DEFAULT
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.learner import Learner
from lira.fusion.learning.novice import NetworkNovice, Novice, Trainer
from lira.fusion.methods.base import Alone, Expert
from lira.fusion.methods.base import Method as Driver
from lira.fusion.methods.cloning import Cloning, CloningSettings
from lira.fusion.methods.doubt import Doubtful, DoubtLog
from lira.fusion.methods.hg_dagger import HgDagger, HgDaggerSettings
from lira.fusion.methods.lira import LiraSettings, LiraSpf
from lira.fusion.methods.plus import LiraPlus, PlusSettings
from lira.fusion.methods.presets import Method
from lira.fusion.methods.shared_feedback import SharedFeedback
from lira.fusion.methods.switching import Switching, SwitchingSettings
from lira.fusion.methods.syllabus import Syllabus
from lira.fusion.policies.ensemble import EnsembleNet
from lira.fusion.policies.kernel_net import KernelNet
from lira.fusion.policies.networks import CameraNet, FusionNet, LidarNet, Network
from lira.fusion.teaching.session import Apprentice, Drive
from lira.fusion.teaching.teacher import ScriptedTeacher, TeacherSettings
from lira.hal.errors import ConfigError
from lira.hal.messages import Episode
from lira.hal.profile import RobotProfile
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.layout import build
from lira.sim_backend.world import World
from lira.tools.runs.warm_start import warm_up

PATIENCE = 4.0  # a lap may take so many times as long as at full speed


@dataclass(frozen=True, slots=True)
class Crew:
    """Whoever takes part in a method: `pupil` learns (None where nobody does), `alone` drives in a phase without help.

    `answered`: a teacher answers the robot that drives alone on unseen layouts, since it may stop in doubt.
    """

    pupil: Apprentice | None
    alone: Callable[[str], Driver]
    answered: bool = False

    def close(self) -> None:
        """End the training, in bounded time."""
        if self.pupil is not None:
            self.pupil.novice.close()


def crew(
    method: Method, profile: RobotProfile, seed: int, trainer: Callable[[Learner], Trainer], pair: str = DEFAULT
) -> Crew:
    """Put a method together around a pair of experts for this robot, warm start included. Raises `ConfigError`."""
    approach = method.approach
    if isinstance(approach, SwitchingSettings):
        camera, lidar = (expert for _, expert in experts(profile, pair))
        rule = Switching(camera, lidar, approach, profile.features.max_range_m)
        return Crew(None, lambda _: rule)
    pupil = apprentice(method, profile, seed, trainer, pair)
    doubtful: Doubtful | None = None
    asks: tuple[str, ...] = ()
    match pupil, approach:
        case HgDagger(log=DoubtLog() as log), HgDaggerSettings():
            doubtful, asks = Doubtful(pupil.novice.alone, log.exceeds), approach.doubt
        case LiraPlus(novice=KernelNovice() as novice), PlusSettings():
            doubtful, asks = Doubtful(novice.alone, novice.doubts), ("unseen",) if approach.ask else ()
    frozen = {"prove": Alone("novice", pupil.novice.proving), "unseen": Alone("novice", pupil.novice.alone)}
    return Crew(
        pupil,
        lambda phase: doubtful if doubtful is not None and phase in asks else frozen[phase],
        answered="unseen" in asks,
    )


def apprentice(
    method: Method, profile: RobotProfile, seed: int, trainer: Callable[[Learner], Trainer], pair: str = DEFAULT
) -> LiraSpf | HgDagger | SharedFeedback | Cloning:
    """Build who learns by a method. Raises `ConfigError` for a method by which nobody does."""
    approach = method.approach
    if isinstance(approach, SwitchingSettings):
        raise ConfigError(f"by the method '{method.name}' nobody learns", "Choose another one.")
    (camera, camera_expert), (lidar, lidar_expert) = experts(profile, pair)
    if not isinstance(camera, CameraNet) or not isinstance(lidar, LidarNet):
        raise ConfigError("the experts are of the wrong kind", "Train them anew: lira train-expert camera|lidar")
    novice, log = _novice(method, camera, lidar, seed, trainer)
    warm_up(novice, method.warm, profile, pair)
    match approach:
        case HgDaggerSettings():
            return HgDagger(novice, log)
        case PlusSettings():
            return LiraPlus([camera_expert, lidar_expert], novice, approach, profile.period_s)
        case CloningSettings():
            return Cloning(novice)
        case LiraSettings():
            lira = LiraSpf([camera_expert, lidar_expert], novice, approach, profile.period_s)
            return lira if method.sharing is None else SharedFeedback(lira, method.sharing)


def _novice(
    method: Method, camera: CameraNet, lidar: LidarNet, seed: int, trainer: Callable[[Learner], Trainer]
) -> tuple[Novice, DoubtLog | None]:
    """Build the learner of a method, and the log of its ensemble's doubts if it has one."""
    if method.kernel is not None:
        sees = KernelNet.from_experts(camera, lidar)
        return KernelNovice(sees, method.learning, method.kernel, mirrored=method.mirrored), None
    frozen, shape, log = method.trunks == "frozen", camera.trunk, None
    network = (
        FusionNet.from_experts(camera, lidar, seed=seed)
        if frozen
        else FusionNet(lidar.trunk.bins, shape.filters, px=shape.px, seed=seed)
    )
    if isinstance(method.approach, HgDaggerSettings) and method.approach.doubt:
        network = ensemble = EnsembleNet(network, method.approach.ensemble, seed)
        log = DoubtLog(ensemble.opinions)
    learner = Learner(network, seed=seed, frozen_trunks=frozen, mirrored=method.mirrored)
    return NetworkNovice(network, trainer(learner), method.learning), log


def experts(profile: RobotProfile, pair: str = DEFAULT) -> list[tuple[Network, Expert]]:
    """Load the camera and the lidar expert of a pair. Raises `ConfigError`."""
    loaded = [(name, *load_network(f"{name}-expert", profile, pair)) for name in SHIPPED]
    return [(network, as_expert(name, network, file.cruise)) for name, network, file in loaded]


def teacher(skill: TeacherSettings, profile: RobotProfile, world: World, layout: int, seed: int) -> ScriptedTeacher:
    """Build a scripted teacher that can look ahead in a twin of its own."""
    return ScriptedTeacher(Foresight(profile, world, layout), profile, skill, seed)


class Course:
    """The laps of a run in one world: what is taught, what has to be proven, and what is shown afterwards."""

    def __init__(self, profile: RobotProfile, world: World, layout: int, syllabus: Syllabus) -> None:
        self._lap = partial(lap, profile, world)
        self._layout = layout
        self._syllabus = syllabus
        self.spare = syllabus.spare

    def taught(self, number: int) -> list[Drive]:
        """The training lap of this number, from 1."""
        return [self._lap(self._syllabus.taught(self._layout, number))]

    def proven(self, number: int) -> list[list[Drive]]:
        """The proving runs after it."""
        return [[self._lap(layout)] for layout in self._syllabus.proven(self._layout, number)]

    def unseen(self, first: int, count: int) -> list[Drive]:
        """Laps of layouts that nobody is taught on."""
        return [self._lap(first + k) for k in range(count)]


def lap(profile: RobotProfile, world: World, layout: int) -> Drive:
    """One lap of a world, with time enough for slow parts."""
    curve = build(world, layout).curve
    length_m = world.limits.finish_m or curve.length_m * world.limits.laps
    return Drive(Episode(layout), limit_s=PATIENCE * length_m / profile.base.max_linear_m_s)
