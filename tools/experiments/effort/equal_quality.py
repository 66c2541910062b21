"""What is said about trials that were taught to a quality: the effort to each level, the curve, how good it drives."""

from collections.abc import Mapping, Sequence

import msgspec

from lira.tools.experiments.effort import pairs
from lira.tools.experiments.effort.measures import median
from lira.tools.experiments.experiment import Outcomes, Row
from lira.tools.experiments.quality import Judged, Point
from lira.tools.experiments.trial import Outcome
from lira.tools.output.proven import share

QUANTITIES = ("human_labels", "interventions", pairs.TOTAL)
TAILS = ("human_labels", "interventions")
_FINE = (0, 5, 10, 15, 20, 30, 40, 60, 80, 120, 160, 240)
ALONG = {  # where a curve is read
    "human_labels": _FINE,
    "interventions": (0, 1, 2, 3, 5, 7, 10, 14, 20, 30, 40, 60),
    "human_s": _FINE,
    "calls": (0, 5, 10, 20, 35, 50, 75, 100, 150, 200, 300, 400),
}
Groups = Mapping[str, Sequence[Outcome]]


class Reached(Point, frozen=True, kw_only=True):
    """What a level of quality took, or where it was not reached, all that was used."""

    converged: bool


def reached(outcome: Outcome, level: float) -> Reached:
    """The first point that is good enough, else the last one."""
    good = next((point for point in outcome.points if point.reaches(level, layouts(outcome))), None)
    return Reached(**msgspec.structs.asdict(good or outcome.points[-1]), converged=good is not None)


def layouts(outcome: Outcome) -> int:
    """How many layouts make a point."""
    return outcome.trial.quality.layouts if outcome.trial.quality is not None else 12


def tried(outcomes: Outcomes, level: float | None, way: str) -> list[Judged]:
    """How those that had just reached a level (None: that were taught on) drove in one way."""
    judged = [each for outcome in outcomes for each in outcome.judged if each.way == way]
    return [each for each in judged if (level in each.levels if level is not None else not each.levels)]


def effort_row(group: Outcomes, level: float) -> Row:
    """Effort to a level: medians, the 90 % quantile and the worst; then the layouts that decided nothing."""
    efforts = [reached(outcome, level) for outcome in group]
    row: Row = {"n": len(group), "censored": sum(not each.converged for each in efforts)} | tails(efforts)
    for quantity in ("demonstration", "human_s", "calls", "lap"):
        row[quantity] = median([pairs.taken(each, quantity) for each in efforts])
    return row | driving_row(tried(group, level, "plain"), "unseen")


def tails(efforts: Sequence[Point]) -> Row:
    """Median, 90 % quantile and worst of what was taken."""
    row: Row = {}
    for quantity in TAILS:
        values = sorted(pairs.taken(each, quantity) for each in efforts)
        row |= {quantity: median(values), f"{quantity}_90": tail(values), f"{quantity}_max": values[-1]}
    return row


def driving_row(judged: Sequence[Judged], name: str) -> Row:
    """How many layouts were passed, the share's 95 % interval, and what went wrong."""
    laps, passed = sum(each.layouts for each in judged), sum(each.passed for each in judged)
    low, high = share(passed, laps) if laps else (None, None)
    driven_m, collisions = sum(each.driven_m for each in judged), sum(each.collisions for each in judged)
    return {
        f"{name}_laps": laps,
        f"{name}_passed": passed,
        "share_low": low,
        "share_high": high,
        "collisions": collisions,
        "collisions_100m": 100.0 * collisions / driven_m if driven_m else None,
        "lost": sum(each.lost for each in judged),
        "stops": sum(each.stops for each in judged),
    }


def tail(values: Sequence[float]) -> float:
    """The 90 % quantile of sorted values, as one of them."""
    return values[min(len(values) - 1, round(0.9 * (len(values) - 1)))]


def quality_rows(groups: Groups, level: float) -> list[Row]:
    """One row per method and pair of experts."""
    return [
        {"method": name, "pair": pair, "quality": level} | effort_row(_of(group, pair), level)
        for name, group in groups.items()
        for pair in dict.fromkeys(each.trial.pair for each in group)
    ]


def effort_rows(groups: Groups, level: float) -> list[Row]:
    """One row per method, all pairs of experts together."""
    return [{"method": name, "quality": level} | effort_row(group, level) for name, group in groups.items()]


def _of(group: Outcomes, pair: str) -> list[Outcome]:
    return [each for each in group if each.trial.pair == pair]


def ratio_rows(groups: Groups, base: str, level: float) -> list[Row]:
    """Every method's effort over the base's, pair by pair of one seed and one pair of experts."""
    compared = [(base, name) for name in groups if name != base]
    rows = pairs.ratios(groups, compared, QUANTITIES, lambda outcome: reached(outcome, level))
    return [{**row, "quality": level} for row in rows]


def way_rows(groups: Groups, level: float) -> list[Row]:
    """How those that reached a level drive in each way in which they could be deployed."""
    ways = list(dict.fromkeys(each.way for group in groups.values() for o in group for each in o.judged))
    return [
        {"method": name, "deployed": way} | driving_row(judged, "unseen")
        for name, group in groups.items()
        for way in ways
        if (judged := tried(group, level, way))
    ]


def more_rows(groups: Groups) -> list[Row]:
    """Whether more laps of teaching spoil it: at the highest level, and after the laps that followed."""
    rows: list[Row] = []
    for name, group in groups.items():
        level = max((level for o in group for each in o.judged for level in each.levels), default=None)
        on = [outcome for outcome in group if any(not each.levels for each in outcome.judged)]
        if level is None or not on:
            continue
        proven, last = [reached(outcome, level) for outcome in on], [outcome.points[-1] for outcome in on]
        for words, efforts, judged in (
            ("proven", proven, tried(on, level, "plain")),
            ("taught on", last, tried(on, None, "plain")),
        ):
            rows.append({"method": name, "when": words} | tails(efforts) | driving_row(judged, "unseen"))
    return rows


def curve(outcomes: Outcomes, quantity: str, at: float) -> tuple[float, float | None]:
    """Mean share of layouts passed, and collisions per 100 m, by the novices that at most so much had been spent on.

    Who had not come to a proving run by then passes nothing; who was taught no further stays as it was.
    """
    newest = [
        next((p for p in reversed(o.points) if p.layouts and pairs.taken(p, quantity) <= at), None) for o in outcomes
    ]
    there = [point for point in newest if point is not None]
    driven_m = sum(point.driven_m for point in there)
    rate = 100.0 * sum(point.collisions for point in there) / driven_m if driven_m else None
    return sum(point.passed / point.layouts for point in there) / len(outcomes), rate


def curve_rows(groups: Groups) -> list[Row]:
    """The curves as numbers: the share passed and the collisions per 100 m where each quantity had come to a value."""
    return [
        {"method": name, "quantity": quantity, "at": at, "share": rate, "collisions_100m": collisions}
        for name, group in groups.items()
        for quantity, ats in ALONG.items()
        for at in ats
        for rate, collisions in [curve(group, quantity, at)]
    ]


def curve_table(rows: Sequence[Row], quantity: str) -> list[Row]:
    """The share passed of one quantity's curve, in percent: a row per method, a column for every second value."""
    table: dict[object, Row] = {}
    for row in rows:
        if row["quantity"] == quantity and row["at"] in ALONG[quantity][::2]:
            shares = table.setdefault(row["method"], {"method": row["method"]})
            shares[f"{row['at']}"] = round(100.0 * float(str(row["share"])))
    return list(table.values())
