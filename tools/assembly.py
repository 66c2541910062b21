"""Puts learners together: which networks, which experts, which method, which teacher, which lap."""

from collections.abc import Callable

from fusion.experts import as_expert, load_network
from fusion.hg_dagger import HgDagger
from fusion.learner import Learner
from fusion.lira import LiraSettings, LiraSpf
from fusion.networks import CameraNet, FusionNet, LidarNet
from fusion.novice import LearningSettings, Novice, Trainer
from fusion.session import Drive
from fusion.teacher import ScriptedTeacher, TeacherSettings
from hal.errors import ConfigError
from hal.messages import Episode
from hal.profile import RobotProfile
from sim_backend.foresight import Foresight
from sim_backend.layout import build
from sim_backend.world import World

PATIENCE = 4.0  # a lap may take so many times as long as at full speed


def apprentice(
    lira: LiraSettings | None,
    profile: RobotProfile,
    seed: int,
    trainer: Callable[[Learner], Trainer],
    learning: LearningSettings | None = None,
) -> LiraSpf | HgDagger:
    """Build LIRA-SPF, or without settings for it HG-DAgger, around a novice with the experts' frozen trunks."""
    camera, camera_file = load_network("camera-expert", profile)
    lidar, lidar_file = load_network("lidar-expert", profile)
    if not isinstance(camera, CameraNet) or not isinstance(lidar, LidarNet):
        raise ConfigError("the experts are of the wrong kind", "Train them anew: lira train-expert camera|lidar")
    network = FusionNet.from_experts(camera, lidar, seed=seed)
    novice = Novice(network, trainer(Learner(network, seed=seed, frozen_trunks=True)), learning or LearningSettings())
    if lira is None:
        return HgDagger(novice)
    experts = [as_expert("camera", camera, camera_file.cruise), as_expert("lidar", lidar, lidar_file.cruise)]
    return LiraSpf(experts, novice, lira, profile.period_s)


def teacher(skill: TeacherSettings, profile: RobotProfile, world: World, layout: int, seed: int) -> ScriptedTeacher:
    """Build a scripted teacher that can look ahead in a twin of its own."""
    return ScriptedTeacher(Foresight(profile, world, layout), profile, skill, seed)


def lap(profile: RobotProfile, world: World, layout: int) -> Drive:
    """One lap of a world, with time enough for slow parts."""
    curve = build(world, layout).curve
    length_m = world.limits.finish_m or curve.length_m * world.limits.laps
    return Drive(Episode(layout), limit_s=PATIENCE * length_m / profile.base.max_linear_m_s)
