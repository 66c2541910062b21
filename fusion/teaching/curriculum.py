"""What each task's experts are trained on: the world, the drives, how strict the teacher is, and the proof."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import msgspec
import numpy as np

from lira.fusion.experts.files import tasks_with
from lira.fusion.experts.tasks import DEFAULT, TASKS
from lira.fusion.teaching.ride import Drive
from lira.fusion.teaching.teacher import PERFECT, SKILLED, TeacherSettings
from lira.hal.errors import ConfigError
from lira.hal.messages import Episode


@dataclass(frozen=True, slots=True)
class Curriculum:
    """A training course for one single-sensor expert. A lap is all `drives`; at most so many `laps` are taught.

    With `proofs` every lap is driven anew, see `Anew`, and proven is who passes so many in a row that nobody was taught
    on; without, who passes the drives that were taught. `mirrored`: left and right are alike there, so each label is
    learned with both exchanged, too. `back`: its drives lead back to a way. A training step follows every
    `labels_per_step`. `cruise_world` shows the sensor nothing for the first `cruise_steps`: the cruise action is
    measured there.
    """

    world: str
    teacher: TeacherSettings
    drives: tuple[Drive, ...]
    laps: int
    proofs: int = 0
    mirrored: bool = False
    back: bool = False
    labels_per_step: int = 30
    cruise_world: str = "straight"
    cruise_steps: int = 25


TAUGHT, PROVEN = 0, 1  # streams of a seed's draws
LAYOUTS = 1_000_000
APART_M = 4.0  # two starts of a lap beside each other
LEAST = 0.5  # of how far off the way a drive begins
PROOFS = 3  # more of them are a matter of luck: of the shipped camera's ways back 3 % are too long


@dataclass(frozen=True, slots=True)
class Anew:
    """A curriculum of which every lap, and every proof, is driven elsewhere.

    Each drive gets a layout of its own and begins up to `APART_M` further on, as far beside the way and as askew as it
    was or down to `LEAST` of that, on either side of it and askew to either side: both together in a curriculum that
    leads `back`, so that who drove back to the way still does.
    """

    course: Curriculum
    seed: int
    spare: int = 0

    def taught(self, number: int, /) -> Sequence[Drive]:
        """The drives of a training lap, numbers counting from 1."""
        return self._draw(TAUGHT, number)

    def proven(self, number: int, /) -> Sequence[Sequence[Drive]]:
        """The proving runs after it."""
        return [self._draw(PROVEN, number, k) for k in range(self.course.proofs)]

    def _draw(self, *stream: int) -> list[Drive]:
        random = np.random.default_rng([self.seed, *stream])
        return [_elsewhere(drive, random, together=self.course.back) for drive in self.course.drives]


def _elsewhere(drive: Drive, random: np.random.Generator, *, together: bool) -> Drive:
    layout, further_m = int(random.integers(LAYOUTS)), float(random.uniform(0.0, APART_M))
    sides = random.choice((-1.0, 1.0), 1 if together else 2)
    aside, askew = (sides * random.uniform(LEAST, 1.0, 2)).tolist()
    began = drive.episode
    start_m = began.start_m + further_m if began.start_m else 0.0
    episode = Episode(layout, start_m, aside * began.lateral_m, askew * began.yaw_rad)
    return replace(drive, episode=episode)


STRICT = msgspec.structs.replace(PERFECT, style="proportional")  # experts are to be good: shown without faults
STRAIGHT_ON = msgspec.structs.replace(STRICT, margin_m=0.2, horizon_s=2.0, follow_line=False)
ASKEW = ((0.15, 0.0), (-0.15, 0.0), (0.3, 0.1), (-0.3, -0.1), (0.0, 0.2), (0.0, -0.2))  # metres aside, and yaw
BESIDE = ((0.5, -0.3), (-0.5, 0.3), (0.9, -0.6), (-0.9, 0.6), (0.9, 0.0), (-0.9, 0.0), (0.3, 0.5), (-0.3, -0.5))
# As a novice comes back from behind a box: mostly across the line, of which little is in view then.
ACROSS = ((0.5, -0.3), (0.6, -1.2), (0.9, -0.6), (0.9, -1.2), (0.9, 0.0), (0.5, -0.9), (0.3, 0.5), (0.7, -1.0))


def _line_camera(
    teacher: TeacherSettings, askew: Sequence[tuple[float, float]], apart_m: float, back_s: float, back_m: float
) -> Curriculum:
    """A lap of the curved line, then starts beside it and askew: the expert has to find its way back (fig. E.2b)."""
    recoveries = [
        Drive(
            Episode(0, start_m=3.0 + apart_m * k, lateral_m=lateral, yaw_rad=yaw),
            back_s,
            "stay",
            final_lateral_m=back_m,
        )
        for k, (lateral, yaw) in enumerate(askew)
    ]
    teacher = msgspec.structs.replace(teacher, lateral_m=0.2)
    return Curriculum("line", teacher, (Drive(Episode(0), 300.0), *recoveries), laps=12, back=True)


def _line_lidar() -> Curriculum:
    """Forests from sparse to dense, straight on until something is in the way (fig. E.1)."""
    drives = tuple(
        Drive(Episode(layout, lateral_m=lateral, yaw_rad=yaw), 60.0, "stay")
        for layout, (lateral, yaw) in enumerate(ASKEW * 3)
    )
    return Curriculum("forest", STRAIGHT_ON, drives, laps=12, labels_per_step=10)


def _passage() -> Curriculum:
    """Openings, corridors, walls and boxes, the same for both sensors; straight on where there are none (fig. 6).

    Each from a few metres before it: nothing on the open floor between them tells a sensor which way leads on.
    """
    teacher = msgspec.structs.replace(STRICT, margin_m=0.15, lateral_m=1.5, stray_m=0.3)
    places = ((10.5, 4.5), (15.3, 7.0), (29.0, 7.3), (37.8, 5.0), (43.5, 7.0), (51.0, 4.5))
    through = [
        Drive(Episode(0, start_m=start, lateral_m=lateral), limit_s, "stay", final_lateral_m=0.8)
        for lateral in (0.0, 0.15, -0.15)
        for start, limit_s in places
    ]
    around = [Drive(Episode(layout, start_m=start), 6.0, "stay") for layout in range(2) for start in (1.0, 22.0)]
    open_floor = [Drive(Episode(0, start_m=start), 2.5, "stay", final_lateral_m=0.25) for start in (0.0, 56.0)]
    drives = (*open_floor, *through, *around)
    return Curriculum("passage-train", teacher, drives, laps=20, cruise_world="passage", cruise_steps=10)


def _garden_camera() -> Curriculum:
    """Along the steel edge without the box, from the start and from beside the way (fig. 14)."""
    return _edge("garden-train", askew=[(0.2, -0.2), (-0.15, 0.2), (0.3, 0.0), (-0.15, 0.0)], starts=(1.0, 6.0))


def _garden_lidar() -> Curriculum:
    """Put before boxes in the open, nearer and farther to either side (fig. F.1)."""
    teacher = msgspec.structs.replace(STRICT, margin_m=0.15, horizon_s=3.0, follow_line=False)
    places = [(2.8, 0.1), (2.8, -0.1), (3.0, 0.25), (3.0, -0.25), (2.6, 0.4), (2.6, -0.4)]
    drives = tuple(
        Drive(Episode(layout, start_m=start, lateral_m=lateral), 30.0, "stay")
        for layout, (start, lateral) in enumerate(places)
    )
    return Curriculum("forest", teacher, drives, laps=12)


def _corridor_camera() -> Curriculum:
    """Down the middle of the corridor, with white spots alone on its floor (fig. F.2a)."""
    return _edge("corridor-train", askew=[(0.4, 0.0), (-0.4, 0.0), (0.3, 0.3), (-0.3, -0.3)], starts=(4.0,))


def _edge(world: str, askew: Sequence[tuple[float, float]], starts: Sequence[float]) -> Curriculum:
    """Back to the way from places and headings beside it, then all of it, at the real robot's pace."""
    teacher = msgspec.structs.replace(STRICT, lateral_m=0.2, stray_m=0.2)
    recoveries = [
        Drive(Episode(k, start_m=start, lateral_m=lateral, yaw_rad=yaw), 10.0, "stay", final_lateral_m=0.2)
        for start in starts
        for k, (lateral, yaw) in enumerate(askew)
    ]
    return Curriculum(world, teacher, (*recoveries, Drive(Episode(0), 240.0)), laps=12, cruise_world=world)


def _table_top_depth() -> Curriculum:
    """Straight on until something is in the way, be it a table top or a box; put before them askew and from afar."""
    drives = tuple(
        Drive(Episode(layout, start_m=start_m, lateral_m=lateral, yaw_rad=yaw), 12.0, "stay")
        for layout, (start_m, (lateral, yaw)) in enumerate(product((1.0, 5.0), ASKEW))
    )
    return Curriculum("table-top-train", STRAIGHT_ON, drives, laps=20)


def _anew(course: Curriculum) -> Curriculum:
    """The same, each lap driven anew, where left and right are alike: an expert that is as good whatever its seed."""
    return replace(course, proofs=PROOFS, mirrored=True)


CURRICULA = {
    DEFAULT: {
        "camera": _anew(_line_camera(STRICT, 2 * ACROSS, apart_m=2.8, back_s=5.0, back_m=0.2)),
        "lidar": _anew(_line_lidar()),
    },
    # Appendix C is about an expert taught as a person does: bang-bang.
    "eight": {"camera": _line_camera(SKILLED, BESIDE, apart_m=4.0, back_s=8.0, back_m=0.35)},
    "passage": {"camera": _passage(), "lidar": _passage()},
    "garden": {"camera": _garden_camera(), "lidar": _garden_lidar()},
    "corridor": {"camera": _corridor_camera()},
    "table-top": {"depth": _table_top_depth()},
}


def curriculum(kind: str, task: str) -> Curriculum:
    """Return what a task's expert is trained on; it may be another task's, see `Task`.

    Raises `ConfigError` for a sensor that the task has no expert for.
    """
    owner = TASKS[task].owner(kind)
    if kind not in CURRICULA[owner]:
        trained = " or ".join(f"--task {name}" for name in tasks_with(kind))
        raise ConfigError(f"the task '{task}' has no {kind} expert", f"Train one with {trained}.")
    return CURRICULA[owner][kind]
