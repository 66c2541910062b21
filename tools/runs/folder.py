"""What a learning run leaves in its folder: every label, the record of its steps, and the novice."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from lira.fusion.inference.checkpoint import Checkpoint, save_checkpoint
from lira.fusion.learning.labels import Label
from lira.fusion.learning.learned_policy import Contradiction, LearnedPolicy
from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.log.run_log import ContradictionRecord, RunRecord
from lira.fusion.methods.base import Method
from lira.fusion.operator_service import Job
from lira.hal.errors import ConfigError
from lira.hal.profile import RobotProfile
from lira.hal.words import plural
from lira.tools.output.proven import contradiction_words
from lira.tools.runs.names import LABELS, NOVICE, RECORD


def check_fresh(folder: Path) -> None:
    """Raise `ConfigError` if a folder already holds a run."""
    if (folder / RECORD).exists() or (folder / LABELS).exists():
        raise ConfigError(f"{folder} already holds a run", "Choose another folder with --run.")


def snapshot(
    folder: Path,
    novice: LearnedPolicy,
    profile: RobotProfile,
    head: RunRecord,
    sync: Callable[[], None] = lambda: None,
) -> Job:
    """Take what was learned as it is now; what is returned writes it, may run aside, and says what it wrote.

    `sync` makes sure of the labels. The writing raises `StorageError`.
    """
    labels, steps, network = novice.stored, novice.training_steps, novice.frozen()
    aside = novice.set_aside()

    def write() -> str:
        sync()
        if steps == 0:
            return f"saved {plural(labels, 'label')} learned in {folder}; there is no novice yet"
        if network is None:
            return f"saved {plural(labels, 'label')} learned in {folder}; this method's novice has no network to save"
        about = Checkpoint.of(network, profile.name, head.command, head.seed)
        about = replace(about, labels=labels, training_steps=steps)
        save_checkpoint(folder / NOVICE, network, about)
        doubtful = contradiction_words(in_the_log(folder / LABELS, aside))
        taught = plural(steps, "training step")
        saved = f"saved {plural(labels, 'label')} learned, and the novice after {taught}, in {folder}"
        return "\n".join(filter(None, [saved, doubtful]))

    return write


def learn_again(method: Method, log: Path) -> None:
    """Have a method learn all that is in a log and was not taken back."""
    for old in read_demonstrations(log):
        if old.stored:
            method.remember(Label(old.features, old.action, old.source, method.novice.weight(old.source)))


def in_the_log(path: Path, found: Sequence[Contradiction]) -> list[ContradictionRecord]:
    """Find labels that a novice set aside in the log of all that it learned."""
    if not found:
        return []
    learned = [(number, label) for number, label in enumerate(read_demonstrations(path)) if label.stored]
    places = [(each, *learned[each.number]) for each in found if each.number < len(learned)]
    return [
        ContradictionRecord(
            number, each.source, label.lap, each.action, each.others, each.mirrored, given_s=label.stamp_s
        )
        for each, number, label in places
    ]
