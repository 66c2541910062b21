"""Puts learners together: which networks, which experts, which method, which teacher, which lap."""

from collections.abc import Callable
from dataclasses import dataclass

from fusion.cloning import Cloning, CloningSettings
from fusion.doubt import Doubtful, DoubtLog
from fusion.ensemble import EnsembleNet
from fusion.expert_files import SHIPPED
from fusion.experts import as_expert, load_network
from fusion.hg_dagger import HgDagger, HgDaggerSettings
from fusion.learner import Learner
from fusion.lira import LiraSettings, LiraSpf
from fusion.method import Alone, Expert
from fusion.method import Method as Driver
from fusion.networks import CameraNet, FusionNet, LidarNet, Network
from fusion.novice import Novice, Trainer
from fusion.plus import LiraPlus, PlusSettings
from fusion.presets import Approach, Method
from fusion.session import Apprentice, Drive
from fusion.shared_feedback import SharedFeedback
from fusion.switching import Switching, SwitchingSettings
from fusion.tasks import DEFAULT
from fusion.teacher import ScriptedTeacher, TeacherSettings
from hal.errors import ConfigError
from hal.messages import Episode
from hal.profile import RobotProfile
from sim_backend.foresight import Foresight
from sim_backend.layout import build
from sim_backend.world import World
from tools.warm import warm_up

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
    novice = Alone("novice", pupil.novice.act)
    if isinstance(pupil, HgDagger) and isinstance(approach, HgDaggerSettings) and pupil.log is not None:
        doubtful = Doubtful(pupil.novice.act, pupil.log)
        return Crew(pupil, lambda phase: doubtful if phase in approach.doubt else novice, "unseen" in approach.doubt)
    return Crew(pupil, lambda _: novice)


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
    frozen = method.trunks == "frozen"
    shape = camera.trunk
    network = (
        FusionNet.from_experts(camera, lidar, seed=seed)
        if frozen
        else FusionNet(lidar.trunk.bins, shape.filters, px=shape.px, seed=seed)
    )
    ensemble: EnsembleNet | None = None
    members = _ensemble(approach)
    if members:
        network = ensemble = EnsembleNet(network, members, seed)
    learner = Learner(network, seed=seed, frozen_trunks=frozen, mirrored=method.mirrored)
    novice = Novice(network, trainer(learner), method.learning)
    warm_up(novice, method.warm, profile, pair)
    log = None if ensemble is None else DoubtLog(ensemble.opinions)
    match approach:
        case HgDaggerSettings():
            return HgDagger(novice, log)
        case PlusSettings():
            return LiraPlus([camera_expert, lidar_expert], novice, approach, profile.period_s, log)
        case CloningSettings():
            return Cloning(novice)
        case LiraSettings():
            lira = LiraSpf([camera_expert, lidar_expert], novice, approach, profile.period_s)
            return lira if method.sharing is None else SharedFeedback(lira, method.sharing)


def _ensemble(approach: Approach) -> int:
    """How many policies an approach asks about its doubt."""
    match approach:
        case HgDaggerSettings(doubt=phases) if phases:
            return approach.ensemble
        case PlusSettings(sure=float()):
            return approach.ensemble
    return 0


def experts(profile: RobotProfile, pair: str = DEFAULT) -> list[tuple[Network, Expert]]:
    """Load the camera and the lidar expert of a pair. Raises `ConfigError`."""
    loaded = [(name, *load_network(f"{name}-expert", profile, pair)) for name in SHIPPED]
    return [(network, as_expert(name, network, file.cruise)) for name, network, file in loaded]


def teacher(skill: TeacherSettings, profile: RobotProfile, world: World, layout: int, seed: int) -> ScriptedTeacher:
    """Build a scripted teacher that can look ahead in a twin of its own."""
    return ScriptedTeacher(Foresight(profile, world, layout), profile, skill, seed)


def lap(profile: RobotProfile, world: World, layout: int) -> Drive:
    """One lap of a world, with time enough for slow parts."""
    curve = build(world, layout).curve
    length_m = world.limits.finish_m or curve.length_m * world.limits.laps
    return Drive(Episode(layout), limit_s=PATIENCE * length_m / profile.base.max_linear_m_s)
