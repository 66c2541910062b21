"""Which labels of a log are meant. Pure: labels in, their numbers out."""

from collections.abc import Sequence
from dataclasses import dataclass

from lira.fusion.log.label_edit import last_intervention
from lira.fusion.log.label_file import Demonstration
from lira.hal.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Wanted:
    """Labels by number, or all of a run that fit the rest; `run` None: the last one."""

    numbers: tuple[int, ...] = ()
    source: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    run: int | None = None

    @property
    def nothing(self) -> bool:
        """Whether nothing was said about which."""
        return self == Wanted()


def choose(labels: Sequence[Demonstration], wanted: Wanted) -> list[int]:
    """Numbers of the labels that are meant; if nothing was said, those of the last intervention.

    Raises `ConfigError` where that is none.
    """
    found = last_intervention(labels) if wanted.nothing else fitting(labels, wanted)
    if wanted.numbers:
        return found
    if wanted.run is None:
        newest = max((labels[number].run for number in found), default=0)
        found = [number for number in found if labels[number].run == newest]
    if not found:
        raise ConfigError("no label is meant by that", "See which there are: lira labels list FILE")
    return found


def fitting(labels: Sequence[Demonstration], wanted: Wanted) -> list[int]:
    """Numbers of the labels of all runs that are meant. Raises `ConfigError` where there is none, or said twice."""
    if not wanted.numbers:
        found = [number for number, each in enumerate(labels) if fits(each, wanted)]
    elif wanted != Wanted(wanted.numbers):
        raise ConfigError("labels are meant by number, or by source, time and run", "Give --number, or the others.")
    else:
        found = sorted(set(wanted.numbers))
        if found[-1] >= len(labels):
            wrong = next(number for number in found if number >= len(labels))
            raise ConfigError(f"there is no label {wrong}", f"They go from 0 to {len(labels) - 1}.")
    if not found:
        raise ConfigError("no label is meant by that", "See which there are: lira labels list FILE")
    return found


def fits(label: Demonstration, wanted: Wanted) -> bool:
    """Whether a label is of the source, the time (to the digit, or as `when` prints it) and the run that is meant."""
    times = label.stamp_s, round(label.stamp_s, 1)
    begins = wanted.from_s is None or max(times) >= wanted.from_s - 1e-6
    ends = wanted.to_s is None or min(times) <= wanted.to_s + 1e-6
    of_run = wanted.run is None or label.run == wanted.run
    return begins and ends and of_run and wanted.source in (None, label.source)


def one_of(labels: Sequence[Demonstration], numbers: Sequence[int]) -> int:
    """Return the only number there is. Raises `ConfigError` where no label has it, or if it is not the only one."""
    if len(numbers) != 1 or numbers[0] >= len(labels):
        raise ConfigError("that is not one label", f"Give one number from 0 to {len(labels) - 1}.")
    return numbers[0]


def nearest(labels: Sequence[Demonstration], time_s: float, run: int | None) -> int:
    """Number of the label that was given nearest to a time of a run (None: the last). Raises `ConfigError`."""
    if run is None:
        run = max((label.run for label in labels), default=0)
    near = [(abs(label.stamp_s - time_s), number) for number, label in enumerate(labels) if label.run == run]
    if not near:
        raise ConfigError(f"there is no label of run {run}", "See which there are: lira labels list FILE")
    return min(near)[1]
