"""A kernel novice from the log of its labels: to say why it does what it does, and without what was taken back."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lira.fusion.inference.checkpoint import load_checkpoint, save_checkpoint
from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.learning.kernel_novice import KernelNovice
from lira.fusion.learning.labels import Label
from lira.fusion.learning.learned_policy import Contradiction
from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.log.run_log import EditRecord, RunRecord, RunWriter, read_run
from lira.fusion.methods.presets import METHODS, Preset
from lira.fusion.policies.kernel import KernelSettings
from lira.hal.errors import ConfigError
from lira.hal.words import plural
from lira.tools.runs.names import LABELS, NOVICE, RECORD


def relearn(log: Path) -> tuple[KernelNovice, list[int]]:
    """Learn a log anew, with the eyes of the novice beside it and the settings of its run; and the labels' numbers.

    Raises `ConfigError` if that novice does not learn from its labels by a kernel, `StorageError` if there is none.
    """
    network, _ = load_checkpoint(log.parent / NOVICE)
    if not isinstance(network, KernelNet):
        what = f"{log.parent / NOVICE} is a network, which cannot tell what it has from which label"
        raise ConfigError(what, "A novice of plus can: lira fusion --method plus")
    preset = preset_of(log.parent)
    novice = KernelNovice(network, preset.learning, preset.kernel or KernelSettings(), mirrored=preset.mirrored)
    learned = []
    for number, label in enumerate(read_demonstrations(log)):
        if label.stored:
            novice.remember(Label(label.features, label.action, label.source, novice.weight(label.source)))
            learned.append(number)
    return novice, learned


def contradictions(novice: KernelNovice, learned: Sequence[int]) -> dict[int, Contradiction]:
    """Which labels contradict the others, by their numbers in the log that it learned."""
    return {learned[each.number]: each for each in novice.set_aside()}


def preset_of(folder: Path) -> Preset:
    """How the novice in a folder was taught, by its record; as by `plus` where there is none."""
    heads = [each for each in read_run(folder / RECORD) if isinstance(each, RunRecord)] if has(folder, RECORD) else []
    return METHODS.get(heads[-1].preset if heads else "plus", METHODS["plus"])


def note(log: Path, count: int, *, stored: bool) -> str:
    """Write into the record of a log's run that labels were changed, and say so; "" where there is none.

    Raises `StorageError`.
    """
    if log.name != LABELS or not has(log.parent, RECORD):
        return ""
    with RunWriter(log.parent / RECORD) as record:
        record.write(EditRecord(learned_again=count) if stored else EditRecord(taken_back=count))
    return f"its report says so once it is made again: lira report {log.parent}"


def rewrite(log: Path) -> str:
    """Write the novice beside a log as the log has it now, if it is one that can be; and say so, or what to do."""
    path = log.parent / NOVICE
    if log.name != LABELS or not has(log.parent, NOVICE):
        return "no novice lies beside this log; one that goes on with it learns it anew"
    try:
        novice, learned = relearn(log)
    except ConfigError:
        return f"{path} still knows them; it is learned anew when teaching goes on: lira fusion --method NAME --run DIR"
    _, about = load_checkpoint(path)
    network = novice.frozen()
    now = network.architecture
    save_checkpoint(path, network, replace(about, labels=len(learned), examples=now.examples, sides=now.sides))
    return f"{path} was learned anew from {plural(len(learned), 'label')}; it has not been proven since"


def has(folder: Path, name: str) -> bool:
    """Whether a file of a run is there."""
    return (folder / name).is_file()
