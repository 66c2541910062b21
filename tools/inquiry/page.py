"""The page of what would have been otherwise: the table, when, and the moments. One file that needs nothing else."""

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from pathlib import Path

from lira.hal.config import write_whole
from lira.hal.words import plural
from lira.tools.inquiry.otherwise import Moment, Otherwise
from lira.tools.inquiry.trace import Step, Trace, steps_of
from lira.tools.report.page import styled
from lira.tools.report.svg import bars, drawing, path, text

LEFT, RIGHT, LINE, TOP = 120.0, 740.0, 26.0, 14.0
MOMENTS = 200


def write_page(file: Path, otherwise: Otherwise, trace: Trace, name: str) -> Path:
    """Write it, and return where. Raises `StorageError`."""
    title = f"{trace.recipe.preset.name} as recorded, and {name}"
    moments, steps = otherwise.moments, plural(otherwise.steps, "step")
    share = len(moments) / otherwise.steps if otherwise.steps else 0.0
    sections = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="outcome">In {len(moments)} of {steps} of teaching ({share:.0%}) another would have '
        "driven, or another call have been made. The robot is where it was, and the human does what they did.</p>",
        _table(("", "recorded", name), [(row.name, f"{row.was}", f"{row.now}") for row in otherwise.rows]),
        f"<h2>When</h2>{_strip(steps_of(trace.calls), moments, trace.began_s)}",
        f"<h2>The moments{f', the first {MOMENTS}' if len(moments) > MOMENTS else ''}</h2>",
        _table(
            ("at", "drove", "would drive", "call", "would call"),
            [
                (f"{each.time_s:.1f} s", each.was_driver, each.now_driver, each.was_call, each.now_call)
                for each in moments[:MOMENTS]
            ],
        ),
    ]
    write_whole(file, styled(title, "".join(sections)).encode())
    return file


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'


def _strip(steps: Sequence[Step], moments: Sequence[Moment], began_s: float) -> str:
    """Two lines over the robot's time: where somebody was called, and where it would have been otherwise."""
    times = [step.time_s - began_s for step in steps]
    if len(times) < 2:
        return ""
    scale = (RIGHT - LEFT) / (times[-1] - times[0])
    period = min((b - a for a, b in pairwise(times) if b > a), default=0.2)

    def spans(at: Sequence[float]) -> list[tuple[float, float]]:
        return [(LEFT + (each - times[0]) * scale, LEFT + (each - times[0] + period) * scale) for each in at]

    called = [
        step.time_s - began_s for step in steps if step.decided is not None and step.decided.choice.call != "none"
    ]
    parts = [
        text((0.0, TOP + 4.0), "a call", "label"),
        path(bars(spans(called), TOP), "s-feedback", 'stroke-width="12"'),
        text((0.0, TOP + LINE + 4.0), "otherwise", "label"),
        path(bars(spans([each.time_s for each in moments]), TOP + LINE), "s-human", 'stroke-width="12"'),
    ]
    return drawing((0.0, 0.0, RIGHT + 10.0, TOP + 2 * LINE), parts, "Calls, and where it would have been otherwise")
