"""Scripted participants of three skills, for a dry run: on a twin in this process, as fast as the machine can."""

from pathlib import Path

import msgspec

from lira.fusion.experts.tasks import TASKS, task_of
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.run_log import RunWriter, VerdictRecord
from lira.fusion.methods.presets import method_named
from lira.fusion.methods.syllabus import THESIS
from lira.hal.messages import Phase
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.tools.live.verdict import has_passed, verdict_words
from lira.tools.runs.names import RECORD
from lira.tools.runs.plan import Plan
from lira.tools.runs.simulated import simulate
from lira.tools.runs.teach import teach_on
from lira.tools.study.plan import StudyPlan
from lira.tools.study.questions import SCALES, Answered

SKILLS = ("perfect", "scripted", "unskilled")
LAPS = 2  # a dry run is to end soon
LOAD = {"perfect": 15, "scripted": 35, "unskilled": 60}


def skill_of(participant: int) -> str:
    """Whose faults a participant has."""
    return SKILLS[(participant - 1) % len(SKILLS)]


def teach_block(plan: StudyPlan, method: str, participant: int, folder: Path) -> None:
    """One block, taught by a script."""
    world = load_world(plan.world)
    profile = load_profile(TASKS[task_of(world.name)].profile)
    preset = msgspec.structs.replace(method_named(method), syllabus=THESIS)
    taught = Plan(
        preset,
        layout=plan.layout,
        seed=plan.seed + participant,
        laps=LAPS,
        unseen=min(1, plan.unseen),
        teacher=skill_of(participant),
        folder=folder,
        command="lira study --dry-run",
    )
    with simulate(world, profile, layout=plan.layout, seed=plan.seed + participant) as robot:
        laps = teach_on(robot, robot.arena, world, taught, InlineTrainer).laps
    proof = [lap for lap in laps if lap.phase == Phase.PROVE][-1:]
    proof += [lap for lap in laps if lap.phase == Phase.UNSEEN]
    with RunWriter(folder / RECORD) as record:  # as a session of a person ends
        record.write(VerdictRecord(skill_of(participant), verdict_words(proof), has_passed(proof)))


def answer(participant: int, place: int, questions: tuple[str, ...]) -> Answered:
    """What a script says afterwards: the same each time."""
    load = LOAD[skill_of(participant)]
    return Answered(
        {name: min(100, load + 3 * place + k) for k, name in enumerate(SCALES)}, dict.fromkeys(questions, "-")
    )
