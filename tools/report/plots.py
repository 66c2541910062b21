"""The drawings of the page: top views, strips of who drove when, densities of labels."""

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

from lira.hal.messages import Action, Call, Driver
from lira.tools.report.course import Course
from lira.tools.report.digest import Lap
from lira.tools.report.svg import Point, bars, dots, drawing, number, path, polyline, text

MARGIN_M = 0.6
PUT_BACK_M = 0.6  # farther than any robot here moves within one decision: it was put down anew
WIDE = 4.0  # a top view with more width per height gets a row of its own, and scrolls
BINS = 21
CALLS = (Call.ATTENTION, Call.FEEDBACK)


def driver_class(driver: str, experts: Sequence[str]) -> str:
    """Style class of a driver: human, novice, mean, or an expert by its place among the experts."""
    if driver in experts:
        return f"e{experts.index(driver) % 4}"
    return driver if driver in (Driver.HUMAN, Driver.NOVICE, Driver.MEAN) else "other"


def top_view(lap: Lap, course: Course, experts: Sequence[str]) -> tuple[str, bool]:
    """Draw where one lap went, coloured by who drove; a dot per decision, so close dots mean slow.

    Returns the drawing and whether it is wide. Without ground truth (a real robot) the drawing is empty.
    """
    track = [(step.decision.driver, (step.state.x_m, step.state.y_m)) for step in lap.steps if step.state is not None]
    if not track:
        return "", False
    box = _bounds([point for _, point in track], course)
    lines: dict[str, list[str]] = defaultdict(list)
    marks: dict[str, list[str]] = defaultdict(list)
    crosses: list[str] = []
    for (before, start), (driver, end) in pairwise(track):
        if math.dist(start, end) > PUT_BACK_M:
            crosses.append(_cross(start))
        else:
            lines[before].append(polyline([start, end]))
        marks[driver].append(dots([end]))
    harmed = lap.record is None or lap.record.collisions + lap.record.lost > 0
    if harmed and lap.record is not None and not crosses:
        crosses.append(_cross(track[-1][1]))
    width = f'stroke-width="{number(course.line_width_m)}"'
    parts = [
        path("".join(polyline(outline, closed=True) for outline in course.marks), "mark"),
        path(polyline(course.line), "course", width),
        path(polyline(course.way), "way"),
        path("".join(polyline(outline, closed=True) for outline in course.boxes), "box"),
    ]
    # The novice first: what the others did is rarer and goes on top.
    for driver in sorted(marks, key=lambda name: (name != Driver.NOVICE, name)):
        css = driver_class(driver, experts)
        parts.append(path("".join(lines[driver]), f"track s-{css}"))
        parts.append(path("".join(marks[driver]), f"steps s-{css}"))
    # What hangs goes over what drives below it.
    parts.append(path("".join(polyline(outline, closed=True) for outline in course.hanging), "hanging"))
    parts.append(path(dots([track[0][1]]), "start"))
    parts.append(path("".join(crosses) if harmed else "", "crash"))
    drawn = drawing(box, ['<g transform="scale(1 -1)">', *parts, "</g>"], f"Top view of {lap.title}")
    return drawn, box[2] / box[3] > WIDE


def _bounds(points: Sequence[Point], course: Course) -> tuple[float, float, float, float]:
    """Return the view box around all but what is only painted on the floor, with y pointing up."""
    corners = (corner for outline in (*course.boxes, *course.hanging) for corner in outline)
    everything = [*points, *course.line, *course.way, *corners]
    xs, ys = [x for x, _ in everything], [y for _, y in everything]
    left, top = min(xs) - MARGIN_M, -max(ys) - MARGIN_M
    return left, top, max(xs) + MARGIN_M - left, -min(ys) + MARGIN_M - top


def _cross(at: Point) -> str:
    (x, y), arm_m = at, 0.2
    slash = polyline([(x - arm_m, y - arm_m), (x + arm_m, y + arm_m)])
    return slash + polyline([(x - arm_m, y + arm_m), (x + arm_m, y - arm_m)])


def strip(lap: Lap, experts: Sequence[str], longest_s: float) -> str:
    """Draw who drove over the time of one lap (`longest_s` fills the width), and below it when the robot called."""
    # A step lasts until the next one; the last as long as the one before it.
    times = [step.decision.stamp_s - lap.began_s for step in lap.steps]
    times.append(times[-1] + (times[-1] - times[-2] if len(times) > 1 else 0.2))
    drove: dict[str, list[tuple[float, float]]] = defaultdict(list)
    called: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for (began, ended), step in zip(pairwise(times), lap.steps, strict=True):
        _extend(drove[step.decision.driver], began, ended)
        _extend(called[step.decision.call], began, ended)
    parts = [path(bars(spans, 8), f"drove s-{driver_class(driver, experts)}") for driver, spans in drove.items()]
    parts += [path(bars(called[call], 19.5), f"called s-{call}") for call in CALLS]
    return drawing(
        (0, 0, max(longest_s, 1.0), 22), parts, f"Who drove in {lap.title}", attributes='preserveAspectRatio="none"'
    )


def _extend(spans: list[tuple[float, float]], began: float, ended: float) -> None:
    """Add a span, merged with the last one where they touch."""
    if spans and spans[-1][1] == began:
        spans[-1] = spans[-1][0], ended
    else:
        spans.append((began, ended))


def density(labels: dict[str, list[Action]], axis: int, title: str, ends: tuple[str, str]) -> str:
    """Draw how many labels lie where on one axis of the action, by source (thesis, figure E.4)."""
    left, right, top, bottom = 44.0, 452.0, 26.0, 196.0
    counts = {source: histogram([action[axis] for action in actions]) for source, actions in labels.items()}
    tallest = max(1, *(max(column) for column in counts.values()))
    step = nice_step(tallest)
    ceiling = step * math.ceil(tallest / step)

    def at(value: float, count: float) -> Point:
        return left + (value + 1) / 2 * (right - left), bottom - count / ceiling * (bottom - top)

    parts = [text((left, 14), title, "heading")]
    for count in range(0, ceiling + 1, step):
        parts.append(path(polyline([at(-1, count), at(1, count)]), "grid"))
        parts.append(text((left - 6, at(0, count)[1] + 4), str(count), "tick end"))
    for source, column in counts.items():
        edges = [-1 + 2 * index / BINS for index in range(BINS + 1)]
        outline = [at(-1, 0)]
        for index, count in enumerate(column):
            outline += [at(edges[index], count), at(edges[index + 1], count)]
        parts.append(path(polyline([*outline, at(1, 0)], closed=True), f"density f-{source}"))
    for value in (-1.0, -0.5, 0.0, 0.5, 1.0):
        parts.append(text((at(value, 0)[0], bottom + 16), f"{value:g}", "tick middle"))
    parts.append(text((left, bottom + 32), ends[0], "tick"))
    parts.append(text((right, bottom + 32), ends[1], "tick end"))
    return drawing((0, 0, 466, 236), parts, title)


def histogram(values: Sequence[float]) -> list[int]:
    """Count values in `BINS` equal bins over [-1, 1]."""
    counts = [0] * BINS
    for value in values:
        counts[min(BINS - 1, max(0, int((value + 1) / 2 * BINS)))] += 1
    return counts


def nice_step(tallest: float) -> int:
    """Distance of about four grid lines: 1, 2 or 5 times a power of ten."""
    rough = max(tallest / 4, 1.0)
    magnitude = 10 ** math.floor(math.log10(rough))
    return int(next(factor * magnitude for factor in (1, 2, 5, 10) if factor * magnitude >= rough))
