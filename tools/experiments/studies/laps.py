"""Whether more teaching makes a novice worse: six laps, whatever it has proven, and 12 fresh layouts after each."""

from collections.abc import Sequence

from msgspec.structs import replace

from lira.fusion.methods.presets import METHODS, Preset
from lira.fusion.methods.syllabus import Syllabus
from lira.tools.experiments.experiment import Experiment, Outcomes, Row, Table
from lira.tools.experiments.measures import by_method, median
from lira.tools.experiments.trial import Outcome, Trial
from lira.tools.output.proven import share

WORLD = "line-obstacles"
LAPS, SHOWN = 6, 12
NAMES = ("plus", "plus-practice")


def examined(name: str) -> Preset:
    """A method whose novice is shown as many layouts after every lap, all of which it may fail."""
    return replace(METHODS[name], syllabus=Syllabus("fresh", SHOWN, SHOWN))


def trials(seeds: int) -> list[Trial]:
    """Each method on every seed."""
    return [
        Trial(examined(name), WORLD, seed, laps=LAPS, all_laps=True, unseen=0)
        for name in NAMES
        for seed in range(seeds)
    ]


def lap_row(group: Sequence[Outcome], lap: int) -> Row:
    """What had been used after a lap, medians over the seeds, and what the novices then passed alone."""
    taught = [each for outcome in group for each in outcome.laps if (each.phase, each.lap) == ("train", lap)]
    shown = [each for outcome in group for each in outcome.laps if (each.phase, each.lap) == ("prove", lap)]
    passed = sum(each.passed for each in shown)
    low, high = share(passed, len(shown))
    return {
        "lap": lap,
        "n": len(taught),
        "human_labels": median([each.human_labels for each in taught]),
        "interventions": median([each.interventions for each in taught]),
        "buffer": median([each.buffer for each in taught]),
        "unseen_laps": len(shown),
        "unseen_passed": passed,
        "share_low": low,
        "share_high": high,
        "collisions": sum(each.collisions for each in shown),
        "lost": sum(each.lost for each in shown),
    }


def rows(outcomes: Outcomes) -> list[Row]:
    """One row for each method and lap."""
    return [
        {"method": name} | lap_row(group, lap)
        for name, group in by_method(outcomes).items()
        for lap in sorted({each.lap for outcome in group for each in outcome.laps})
    ]


def tables(outcomes: Outcomes) -> list[Table]:
    """How each method's novices come on."""
    return [
        Table(
            "After each lap of teaching", rows(outcomes), "Totals since the run began; the layouts are new each time."
        )
    ]


EXPERIMENTS = {
    "laps": Experiment(
        trials=trials,
        tables=tables,
        findings=lambda _: [],  # the thesis stops when a novice is proven
        methods=NAMES,
        usual=NAMES,
    )
}
