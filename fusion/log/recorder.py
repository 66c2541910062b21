"""Writes down what happens at every step: the counts, the labels, the decision for the bus, the run record."""

import time
from collections.abc import Callable
from dataclasses import replace

from lira.fusion.control import Step
from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.log.counts import Ledger
from lira.fusion.log.label_log import Demonstration
from lira.fusion.log.run_log import ContradictionRecord, Pose, Record, ResultRecord, StepRecord
from lira.fusion.methods.base import Proposal
from lira.fusion.preprocess import MODALITIES
from lira.hal.messages import Call, Decision, Driver, Phase


def _nowhere(_: object) -> None:
    """Where a journal without a reader writes to."""


class Journal:
    """Turns steps into records and hands them on.

    `keep` takes labels (the demonstration log), `write` run records, `publish` decisions. Labels go first: they are
    what must not be lost.
    """

    def __init__(
        self,
        *,
        keep: Callable[[Demonstration], None] = _nowhere,
        write: Callable[[Record], None] = _nowhere,
        publish: Callable[[Decision], None] = _nowhere,
    ) -> None:
        self.ledger = Ledger()
        self.write = write
        self._keep = keep
        self._publish = publish
        self._began_s = time.monotonic()
        self._call = Call.NONE
        self._given = 0  # labels handed to the log
        self._learned: list[tuple[int, int, float]] = []  # of those stored: place in the log, lap, time
        self._reserved: dict[int, tuple[Proposal, Demonstration]] = {}  # the proposal too: so its id stays its own

    def aside(self, write: Callable[[Record], None]) -> "Journal":
        """One for another robot of the same run: the same counts and beginning, and nobody hears of its decisions."""
        journal = Journal(write=write)
        journal.ledger, journal._began_s = self.ledger, self._began_s
        return journal

    @property
    def elapsed_s(self) -> float:
        """Wall-clock time since the journal was opened."""
        return time.monotonic() - self._began_s

    def contradictions(self, novice: LearnedPolicy) -> tuple[ContradictionRecord, ...]:
        """What a novice that learned all of this journal's labels set aside, as the log has it."""
        found = novice.set_aside()
        if found and len(self._learned) < novice.stored:
            return ()  # it learned before the journal began, and nobody knows which these are
        places = [(self._learned[each.number], each) for each in found]
        return tuple(
            ContradictionRecord(number, each.source, lap, each.action, each.others, each.mirrored, given_s)
            for (number, lap, given_s), each in places
        )

    def result(
        self,
        *,
        converged: bool,
        laps: int,
        training_steps: int,
        simulated_s: float,
        proof: str,
        contradictions: tuple[ContradictionRecord, ...] = (),
    ) -> ResultRecord:
        """Sum up what happened, of which the journal knows all but this."""
        ledger = self.ledger
        return ResultRecord(
            converged=converged,
            laps=laps,
            human_labels=ledger.labels.stored_human,
            demonstration=ledger.labels.demonstration,
            interventions=ledger.interventions,
            calls=ledger.calls,
            buffer=ledger.buffer,
            training_steps=training_steps,
            simulated_s=simulated_s,
            elapsed_s=self.elapsed_s,
            account=ledger.account,
            proof=proof,
            contradictions=contradictions,
        )

    def note(self, step: Step, *, phase: Phase, lap: int, layout: int, training_steps: int) -> None:
        """Record one step."""
        choice, features = step.lesson.choice, step.proposal.features
        settled = self._keep_labels(step, lap)
        if phase == Phase.TRAIN:
            demonstrating = step.proposal.choice.driver == Driver.NOBODY
            self.ledger.note(step.lesson, now_s=step.observation.stamp_s, demonstrating=demonstrating)
        decision = self._decision(step, phase, lap, training_steps)
        self._publish(decision)
        risen = choice.call not in (Call.NONE, self._call)
        self._call = choice.call
        self.write(
            StepRecord(
                decision,
                state=None if step.state is None else Pose.of(step.state),
                layout=layout,
                label=choice.driver if step.lesson.stored else None,
                image=MODALITIES["image"].keep(features.image).tobytes() if risen and "image" in features else None,
                elapsed_s=self.elapsed_s,
                settled=tuple((label.source, label.action) for label in settled if label.stored),
            )
        )

    def _keep_labels(self, step: Step, lap: int) -> list[Demonstration]:
        """Hand on the step's label, and those of earlier steps on which it was decided now, which are returned."""
        choice, features = step.lesson.choice, step.proposal.features
        if choice.label is not None:
            label = Demonstration(
                stamp_s=step.observation.stamp_s,
                observation=step.observation.seq,
                lap=lap,
                source=choice.driver,
                action=choice.label,
                novice=step.proposal.novice,
                stored=step.lesson.stored,
                features=features,
            )
            if step.lesson.reserved:
                self._reserved[id(step.proposal)] = step.proposal, label
            else:
                self._hand_on(label)
        decided = []
        for settled in step.lesson.settled:
            _, label = self._reserved.pop(id(settled.proposal))
            decided.append(replace(label, stored=settled.stored))
            self._hand_on(decided[-1])
        return decided

    def _hand_on(self, label: Demonstration) -> None:
        self._keep(label)
        if label.stored:
            self._learned.append((self._given, label.lap, label.stamp_s))
        self._given += 1

    def _decision(self, step: Step, phase: Phase, lap: int, training_steps: int) -> Decision:
        choice, proposal = step.lesson.choice, step.proposal
        return Decision(
            stamp_s=step.observation.stamp_s,
            observation=step.observation.seq,
            driver=choice.driver,
            call=choice.call,
            executed=choice.action,
            novice=proposal.novice,
            human=choice.action if choice.driver == Driver.HUMAN else None,
            experts=proposal.experts,
            threshold=proposal.threshold,
            labels=self.ledger.labels,
            training_steps=training_steps,
            interventions=self.ledger.interventions,
            calls=self.ledger.calls,
            phase=phase,
            lap=lap,
        )
