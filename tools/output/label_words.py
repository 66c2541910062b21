"""Labels in words, the same wherever they are counted.

A label is *given* by whoever drives; the log has all that were given. It is *learned* unless it is redundant, objected
to or taken back: what records call stored, altogether the buffer. Its mirror image is no label more. *Human labels* are
what a run asked of the person: the learned ones of theirs, and one for each choice of who drives. What the human shows
before the first training step, the *demonstration*, is counted apart.
"""

from collections.abc import Mapping

from lira.fusion.log.run_log import ResultRecord
from lira.hal.messages import Driver, LabelCounts
from lira.hal.words import plural


def by_source(counts: Mapping[str, int]) -> str:
    """Like: human 17, camera 91."""
    return ", ".join(f"{source} {count}" for source, count in sorted(counts.items(), key=_human_first) if count)


def learned_words(result: ResultRecord) -> str:
    """What a run learned from, and what of that it asked of the person."""
    stored = result.account.stored
    sources = f" ({by_source(stored)})" if result.buffer else ""
    choices = result.human_labels - stored.get(Driver.HUMAN, 0)
    chosen = f", {choices} of them a choice of who drives" if choices > 0 else ""
    return f"{plural(result.buffer, 'label')} learned{sources}; human labels: {result.human_labels}{chosen}"


def so_far_words(counts: LabelCounts) -> str:
    """The same of a run that goes on, in short."""
    words = f"human labels {counts.stored_human}, learned of experts {counts.stored_expert}"
    return f"{words}, of the demonstration {counts.demonstration}" if counts.demonstration else words


def _human_first(item: tuple[str, int]) -> tuple[bool, str]:
    return item[0] != Driver.HUMAN, item[0]
