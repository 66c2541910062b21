"""What a session tells while it goes on: on the bus for every screen, and in the terminal."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from lira.fusion.log.counts import Ledger
from lira.fusion.log.run_log import LapRecord
from lira.fusion.teaching.ride import Tally
from lira.hal.messages import SessionState, Stage
from lira.hal.words import plural
from lira.tools.live.before import Before
from lira.tools.runs.progress import Say

REPORT_S = 0.5
CURVE = 100  # laps


class Board:
    """The newest `state` of a session, which goes on from the days `before`. `now` is the robot's clock."""

    def __init__(
        self,
        person: str,
        before: Before,
        ledger: Ledger,
        now: Callable[[], float],
        publish: Callable[[SessionState], None],
        say: Say,
    ) -> None:
        self.state = SessionState(
            now(),
            Stage.PRACTICE,
            person,
            laps=before.laps,
            passed=before.passed,
            collisions=before.collisions,
            lost=before.lost,
            curve=before.curve[-CURVE:],
        )
        self._ledger, self._now, self._publish, self._say = ledger, now, publish, say
        self._shown_s = float("-inf")

    @property
    def stage(self) -> Stage:
        """Where the session is."""
        return self.state.stage

    def show(self, stage: Stage, layout: int) -> None:
        """Tell how it goes, at once if the stage is another one, else now and then."""
        now_s = time.monotonic()
        if stage is self.state.stage and now_s < self._shown_s + REPORT_S:
            return
        self._shown_s = now_s
        account, labels = self._ledger.account, self._ledger.labels
        self.state = replace(
            self.state,
            stamp_s=self._now(),
            stage=stage,
            layout=layout,
            labels=labels.stored_human + labels.demonstration,
            calls=account.call_episodes,
            answered=account.answered,
            alone=1.0 - account.human_steps / account.steps if account.steps else 0.0,
        )
        self._publish(self.state)

    def begin_lap(self) -> int:
        """Count one more lap of teaching. What was proven was another novice's."""
        self.state = replace(self.state, laps=self.state.laps + 1, proven=0, shown=0, converged=False)
        return self.state.laps

    def give_back_lap(self) -> None:
        """The lap that has begun was none."""
        self.state = replace(self.state, laps=self.state.laps - 1)

    def end_lap(self, tally: Tally, record: LapRecord) -> None:
        """A lap of teaching is over."""
        alone = 1.0 - tally.human_steps / max(1, tally.steps)
        state = self.state
        self.state = replace(
            state,
            passed=state.passed + record.passed,
            collisions=state.collisions + record.collisions,
            lost=state.lost + record.lost,
            curve=(*state.curve, alone)[-CURVE:],
        )
        self._say(
            f"lap {record.lap}: {'passed' if record.passed else 'not passed'}, {alone:.0%} driven without you, "
            f"collisions {record.collisions}, lost {record.lost}, {plural(record.human_labels, 'label')} of yours"
        )

    def note_proof(self, proof: Sequence[LapRecord]) -> None:
        """So far the novice has driven this alone."""
        self.state = replace(self.state, proven=sum(lap.passed for lap in proof), shown=len(proof))

    def note_verdict(self, words: str, *, converged: bool) -> None:
        """The proof is over."""
        self.state = replace(self.state, words=words, converged=converged)
