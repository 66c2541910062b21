"""The human's faults: a perfect, a skilled and an unskilled teacher, and one fault at a time, on line-obstacles."""

from dataclasses import replace

import msgspec

from lira.fusion.teaching.teacher import PERFECT, TEACHERS, UNSKILLED, TeacherSettings
from lira.tools.experiments.effort.measures import driving_row, effort_row, grouped, label_row
from lira.tools.experiments.effort.pairs import bounds, ratio, words
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.methods import HG_DAGGER, LIRA
from lira.tools.experiments.output.pictures import box_pictures
from lira.tools.experiments.trial import Outcome, Trial

WORLD = "line-obstacles"
METHODS = (LIRA[0], HG_DAGGER[0])
FAULTS = {
    "delay": ("delay_s", "called_delay_s"),
    "wrong-direction": ("wrong_direction",),
    "gain": ("gain_sigma",),
    "missed": ("missed",),
}


def alone(fault: str) -> TeacherSettings:
    """A teacher with one of the unskilled teacher's faults, and no other."""
    changes = {name: getattr(UNSKILLED, name) for name in FAULTS[fault]}
    return msgspec.structs.replace(PERFECT, **changes)


SKILLS = {name: TEACHERS[name] for name in ("perfect", "scripted", "unskilled")}
SKILLS |= {f"only-{fault}": alone(fault) for fault in FAULTS}


def trials(seeds: int) -> list[Trial]:
    """Both methods with every teacher on every seed."""
    return [
        Trial(method, WORLD, seed, teacher=name, skill=skill)
        for name, skill in SKILLS.items()
        for method in METHODS
        for seed in range(seeds)
    ]


def groups(outcomes: Outcomes) -> dict[tuple[str, str], list[Outcome]]:
    """Outcomes by teacher and method."""
    return {
        (teacher, method): group
        for teacher, those in grouped(outcomes, lambda each: each.trial.teacher).items()
        for method, group in grouped(those, lambda each: each.trial.method.name).items()
    }


def summary(outcomes: Outcomes) -> list[Row]:
    """One row per teacher and method."""
    kept = ("human_time_s", "precision", "recall")
    return [
        {"teacher": teacher, "method": method}
        | label_row(group)
        | {name: value for name, value in effort_row(group).items() if name in kept}
        | {name: value for name, value in driving_row(group).items() if name.startswith("training_")}
        for (teacher, method), group in groups(outcomes).items()
    ]


def cost(outcomes: Outcomes) -> list[Row]:
    """Human labels with a faulty teacher over those with the perfect one, by pairs of one seed."""
    found = groups(outcomes)
    return [
        {"teacher": teacher, "method": method} | ratio(group, found["perfect", method], "human_labels")
        for (teacher, method), group in found.items()
        if teacher != "perfect"
    ]


def tables(outcomes: Outcomes) -> list[Table]:
    """All teachers, and what their faults cost. The thesis had one teacher, taken for skilled."""
    return [
        Table("Teachers", summary(outcomes), "scripted is the skilled teacher of all other experiments."),
        Table("Human labels over those of the perfect teacher, by pairs of one seed", cost(outcomes)),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Imperfect demonstrations slow the learning down (thesis, chapter VI)."""
    return [
        Finding(
            f"teacher.{row['teacher']}.{row['method']}",
            f"{row['method']}: a {row['teacher']} teacher gives more labels than a perfect one",
            "significant influence",
            words(row),
            bounds(row)[0] > 1.0,
        )
        for row in cost(outcomes)
        if row["teacher"] in ("scripted", "unskilled")
    ]


def figures(outcomes: Outcomes) -> list[Picture]:
    """Labels by teacher, one drawing per method."""
    found = groups(outcomes)
    return [
        replace(picture, name=f"{method.name}-{picture.name}", words=f"{method.name}: {picture.words}")
        for method in METHODS
        for picture in box_pictures(
            {teacher: group for (teacher, name), group in found.items() if name == method.name}, ("human_labels",)
        )
    ]


EXPERIMENTS = {"teacher": Experiment(trials=trials, tables=tables, findings=findings, figures=figures)}
