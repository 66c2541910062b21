"""What the two experts are trained on (appendix E.1): the world, the drives, and how strict the teacher is."""

from dataclasses import dataclass

from fusion.session import Drive
from fusion.teacher import TeacherSettings
from hal.messages import Episode


@dataclass(frozen=True, slots=True)
class Curriculum:
    """A training course for one single-sensor expert."""

    world: str
    teacher: TeacherSettings
    drives: tuple[Drive, ...]
    laps: int


def _camera() -> Curriculum:
    """A lap of the curved line, then starts beside it and askew: the expert has to find its way back (fig. E.2b)."""
    askew = [(0.5, -0.3), (-0.5, 0.3), (0.9, -0.6), (-0.9, 0.6), (0.9, 0.0), (-0.9, 0.0), (0.3, 0.5), (-0.3, -0.5)]
    recoveries = [
        Drive(Episode(0, start_m=3.0 + 4.0 * k, lateral_m=lateral, yaw_rad=yaw), 8.0, "stay", final_lateral_m=0.35)
        for k, (lateral, yaw) in enumerate(askew)
    ]
    teacher = TeacherSettings(
        style="proportional",
        lateral_m=0.2,
        delay_s=0.0,
        called_delay_s=0.0,
        gain_sigma=0.0,
        wrong_direction=0,
        missed=0,
    )
    return Curriculum("line", teacher, (Drive(Episode(0), 300.0), *recoveries), laps=12)


def _lidar() -> Curriculum:
    """Forests from sparse to dense, straight on until something is in the way (fig. E.1)."""
    teacher = TeacherSettings(
        style="proportional",
        margin_m=0.2,
        horizon_s=2.0,
        follow_line=False,
        delay_s=0.0,
        called_delay_s=0.0,
        gain_sigma=0.0,
        wrong_direction=0,
        missed=0,
    )
    askew = [(0.15, 0.0), (-0.15, 0.0), (0.3, 0.1), (-0.3, -0.1), (0.0, 0.2), (0.0, -0.2)]
    drives = tuple(
        Drive(Episode(layout, lateral_m=lateral, yaw_rad=yaw), 60.0, "stay")
        for layout, (lateral, yaw) in enumerate(askew * 3)
    )
    return Curriculum("forest", teacher, drives, laps=12)


CURRICULA = {"camera": _camera(), "lidar": _lidar()}
