"""A scripted teacher for a twin over the bus: it sees everything."""

import argparse
from functools import partial

from lira.fusion.learning.trainer import ProcessTrainer
from lira.hal.client.remote import RemoteRobot
from lira.tools.recording.beside import recorder_beside
from lira.tools.runs.folder import check_fresh
from lira.tools.runs.plan import Plan
from lira.tools.runs.progress import Publish, Say
from lira.tools.runs.remote.reach import arena_of
from lira.tools.runs.teach import teach_on


def teach(args: argparse.Namespace, plan: Plan, robot: RemoteRobot, publish: Publish, say: Say) -> int:
    """Teach until the novice passes its proving run, then let it drive unseen layouts. Returns 1 if it did not pass."""
    in_step = partial(ProcessTrainer, adopt_after_s=robot.profile.period_s)  # one period later, whatever it took
    assert plan.folder is not None
    check_fresh(plan.folder)
    with arena_of(args, robot) as (arena, world), recorder_beside(args, plan.folder, say) as wait_for_recorder:
        wait_for_recorder()
        return 0 if teach_on(robot, arena, world, plan, in_step, say, publish).converged else 1
