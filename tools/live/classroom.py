"""The learner of a session and its files: it goes on another day, and unlearns what a person takes back."""

import contextlib
from pathlib import Path
from typing import Self

from lira.fusion.experts.tasks import task_of
from lira.fusion.learning.trainer import NewTrainer
from lira.fusion.log.counts import Ledger
from lira.fusion.log.label_edit import correct, last_intervention, read_heads
from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.log.run_log import RunRecord
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import Job
from lira.hal.messages import Driver
from lira.hal.profile import RobotProfile
from lira.hal.words import plural
from lira.tools.live.before import days_before
from lira.tools.runs.folder import learn_again, snapshot
from lira.tools.runs.names import LABELS, RECORD
from lira.tools.runs.plan import Plan, build_traced
from lira.tools.runs.progress import Publish, Say


class Classroom:
    """Whoever is taught, by whom it is written down, and where. A context: in the end all is saved and closed.

    Raises `StorageError` for a damaged or foreign log, `ConfigError` for another method than the folder's.
    """

    def __init__(
        self,
        plan: Plan,
        profile: RobotProfile,
        world: str,
        trainer: NewTrainer,
        say: Say,
        publish: Publish | None = None,
    ) -> None:
        assert plan.folder is not None
        self.folder: Path = plan.folder
        self._plan, self._profile, self._world = plan, profile, world
        self._trainer, self._publish, self._say = trainer, publish, say
        self.head: RunRecord = plan.head(profile, world)
        self.before = days_before(self.folder / RECORD, self.head)
        self._log = self._open_log()
        try:
            self.method: Method = self._learned()
        except BaseException:
            self._log.close()
            raise

    def keep(self, label: Demonstration) -> None:
        """Write a label down."""
        self._log.append(label)

    def undo(self, ledger: Ledger) -> tuple[bool, str]:
        """Take the labels of the last intervention back; the learner begins anew without them."""
        self._log.close()
        try:
            numbers = last_intervention(read_heads(self.folder / LABELS))
            taken = correct(self.folder / LABELS, numbers, stored=False)
        finally:
            self._log = self._open_log()
        if not taken:
            return False, "there is no intervention to take back"
        ledger.take_back(Driver.HUMAN, len(taken))
        self.method.close()
        self.method = self._learned()
        return True, f"not learned any more: {plural(len(taken), 'label')} of the last intervention"

    def snapshot(self) -> Job:
        """Take what was learned as it is now; what is returned writes it."""
        return snapshot(self.folder, self.method.novice, self._profile, self.head, self._log.sync)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.closing(self._log):
            self.method.close()

    def _open_log(self) -> DemonstrationLog:
        mirrored = self._plan.preset.mirrored
        return DemonstrationLog(self.folder / LABELS, self._profile, mirrored=mirrored, say=self._say)

    def _learned(self) -> Method:
        """A new learner that has learned all that is in the log."""
        plan = self._plan
        pair = plan.pair or task_of(self._world)
        method = build_traced(plan, self._profile, self._trainer, pair, self._publish)
        learn_again(method, self.folder / LABELS)
        return method
