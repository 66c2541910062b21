"""The page itself: sections of HTML around the drawings. Style, drawings and pictures are all inside."""

import base64
import math
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from statistics import median

import cv2
import numpy as np

from lira.fusion.log.run_log import UNPROVEN
from lira.hal.messages import Call, Driver, Phase
from lira.hal.words import plural
from lira.tools.output.proven import contradiction_words, edit_words, proof_words, unseen_words
from lira.tools.report import plots
from lira.tools.report.answers import COLUMNS as ANSWER_COLUMNS
from lira.tools.report.answers import answer_cells, sum_up
from lira.tools.report.course import course
from lira.tools.report.digest import Lap, Run
from lira.tools.report.laps import COLUMNS, clock, lap_cells

TRAINING_VIEWS, UNSEEN_VIEWS = 6, 12
PICTURES = 24


def render(run: Run) -> str:
    """Return the whole page."""
    title = f"{method_name(run)} on {run.head.world}" if run.head else "A run"
    sections = [head(run, title), lap_table(run), answer_table(run), top_views(run), strips(run), densities(run)]
    return styled(title, "".join([*sections, pictures(run)]))


def styled(title: str, body: str) -> str:
    """A page with its style inside."""
    style = (resources.files("lira.tools") / "report" / "page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head>\n<body>{body}</body></html>\n"
    )


def method_name(run: Run) -> str:
    """Spell the method as the thesis does."""
    method = run.head.method if run.head else ""
    return {"lira": "LIRA-SPF", "hg-dagger": "HG-DAgger"}.get(method, method)


def head(run: Run, title: str) -> str:
    """What was run, how it ended, and the command that repeats it."""
    words, css = outcome(run)
    parts = [f'<h1>{escape(title)}</h1><p class="outcome {css}">{escape(words)}</p>']
    if run.head:
        facts = [
            f"robot profile {run.head.profile}",
            f"preset {run.head.preset}",
            f"layout {run.head.layout}",
            f"seed {run.head.seed}",
            f"idle frames: {run.head.idle_frames}",
            f"version {run.head.version}",
        ]
        parts.append(f'<p class="muted">{escape(" · ".join(facts))}</p>')
    parts.append(f'<dl class="tiles">{"".join(map(tile, figures(run)))}</dl>')
    unseen = [lap.record for lap in run.phase(Phase.UNSEEN) if lap.record]
    if unseen and run.verdict is None:  # which says it of the newest proof alone
        words = unseen_words(unseen)
        parts.append(f"<p>{words[0].upper()}{words[1:]}.</p>")
    contradictions = "" if run.result is None else contradiction_words(run.result.contradictions)
    if contradictions:
        parts.append(f"<p>{escape(contradictions[0].upper() + contradictions[1:])}.</p>")
    if run.head and run.head.command:
        parts.append(f"<p>To repeat it:</p><pre>{escape(run.head.command)}</pre>")
    return "".join(parts)


def outcome(run: Run) -> tuple[str, str]:
    """One line for the end of the run, and its style."""
    words, how = ended(run)
    if since := edit_words(run.edited):
        return f"{words}; {since}", "muted" if how == "good" else how
    return words, how


def ended(run: Run) -> tuple[str, str]:
    """The same, whatever was done to its labels afterwards."""
    if run.verdict is not None:
        return run.verdict.words, "good" if run.verdict.passed else "bad"
    if run.result is None:
        return "Cut off before its end", "bad"
    words = proof_words(run.result)
    how = "good" if run.result.converged else "muted" if run.result.proof == UNPROVEN else "bad"
    return f"{words[0].upper()}{words[1:]}", how


def figures(run: Run) -> Iterable[tuple[str, str]]:
    """Name and value of the numbers at the top."""
    if run.result:
        result = run.result
        yield "human labels", str(result.human_labels)
        yield "labels learned", str(result.buffer)
        yield "demonstration", plural(result.demonstration, "label")
        yield "interventions", str(result.interventions)
        yield "calls", str(result.calls)
        yield "training steps", str(result.training_steps)
        yield "simulated time", clock(result.simulated_s)
        if result.elapsed_s > 0:
            yield "times real time", f"{result.simulated_s / result.elapsed_s:.0f}"
    if run.verdict is not None:
        yield "taught by", run.verdict.person
    human = sum_up(run)
    if human.human_s:
        yield "human drove", f"{human.human_s:.0f} s"
    if human.calls:
        yield "calls missed", f"{human.missed} of {human.calls}"
    if human.reactions_s:
        yield "reaction, median", f"{median(human.reactions_s):.2f} s"
    training = run.phase(Phase.TRAIN)
    alone = [lap.number for lap in training if lap.record and lap.record.unassisted]
    if training:
        yield "lap without help", f"lap {alone[0]}" if alone else "none"


def tile(figure: tuple[str, str]) -> str:
    """One number at the top."""
    name, value = figure
    return f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"


def lap_table(run: Run) -> str:
    """One row per lap."""
    header = "".join(f"<th>{escape(name)}</th>" for name in COLUMNS)
    rows = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in lap_cells(lap)) + "</tr>" for lap in run.laps
    )
    note = "Labels, interventions, calls and training steps are totals since the run began."
    return section("Laps", note, f'<div class="scroll"><table><tr>{header}</tr>{rows}</table></div>')


def answer_table(run: Run) -> str:
    """What each lap asked of the person; nothing where nobody ever drove."""
    if not any(step.decision.driver == Driver.HUMAN for _, step in run.steps()):
        return ""
    header = "".join(f"<th>{escape(name)}</th>" for name in ANSWER_COLUMNS)
    rows = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in answer_cells(lap)) + "</tr>"
        for lap in run.phase(Phase.TRAIN)
    )
    note = "Reaction: from the robot's question to the dead-man. Missed: nobody answered until 2 s after it had ended."
    return section(
        "What it asked of the person", note, f'<div class="scroll"><table><tr>{header}</tr>{rows}</table></div>'
    )


def top_views(run: Run) -> str:
    """Where each lap went: training, the last proving run, the last unseen layouts."""
    training = run.phase(Phase.TRAIN)
    if len(training) > TRAINING_VIEWS:
        training = training[: TRAINING_VIEWS // 2] + training[-(TRAINING_VIEWS // 2) :]
    laps = [*training, *run.phase(Phase.PROVE)[-1:], *run.phase(Phase.UNSEEN)[-UNSEEN_VIEWS:]]
    figures = []
    for lap in laps:
        floor = course(run.head.world, lap.layout) if run.head else course("", lap.layout)
        drawn, wide = plots.top_view(lap, floor, run.experts)
        if drawn:
            css = ' class="wide"' if wide else ""
            figures.append(
                f'<figure{css}><div class="view">{drawn}</div><figcaption>{caption(lap)}</figcaption></figure>'
            )
    if not figures:
        return section("Where it drove", "No ground truth in this record: only a twin knows where the robot is.", "")
    note = "One dot per decision: close dots mean slow. ● start. ✕ collision or lost line: put back and driven on. "
    note += "Dashed: a way that is not painted. Dotted outlines hang above the floor."
    return section("Where it drove", note, legend(run) + f'<div class="views">{"".join(figures)}</div>')


def caption(lap: Lap) -> str:
    """Name of a lap and how it went."""
    if lap.record is None:
        return f"<b>{escape(lap.title)}</b> · cut off"
    verdict = '<span class="good">passed</span>' if lap.record.passed else '<span class="bad">not passed</span>'
    harm = f" · collisions: {lap.record.collisions}, lost lines: {lap.record.lost}" if not lap.record.passed else ""
    return f"<b>{escape(lap.title)}</b> · {verdict}{harm}"


def drivers(run: Run) -> list[tuple[str, str]]:
    """Who drove in this run: words for the legend and the style's name."""
    seen = {step.decision.driver for _, step in run.steps()}
    known: list[tuple[str, str]] = [(Driver.NOVICE, "novice"), (Driver.HUMAN, "human")]
    known += [(name, f"{name} expert") for name in run.experts]
    known += [(Driver.MEAN, "mean of the experts"), (Driver.SHIELD, "the shield, instead of the novice")]
    return [(words, plots.driver_class(name, run.experts)) for name, words in known if name in seen]


def legend(run: Run, more: Sequence[tuple[str, str]] = ()) -> str:
    """Colours and what they mean."""
    keys = [(words, f"var(--{css})") for words, css in drivers(run)] + list(more)
    return '<div class="legend">' + "".join(key(*entry) for entry in keys) + "</div>"


def key(words: str, colour: str) -> str:
    """One entry of a legend."""
    return f'<span style="--key:{colour}">{escape(words)}</span>'


def strips(run: Run) -> str:
    """Who drove when, one strip per lap."""
    laps = [lap for lap in run.laps if lap.steps]
    if not laps:
        return ""
    longest_s = max(1.0, *(lap.duration_s for lap in laps))
    rows = [f"<span>{escape(lap.title)}</span>{plots.strip(lap, run.experts, longest_s)}" for lap in laps]
    ticks = "".join(
        f'<span style="left:{100 * seconds / longest_s:.1f}%">{clock(seconds)}</span>'
        for seconds in range(0, int(longest_s) + 1, time_step(longest_s))
    )
    colours = legend(run, [("attention call", "var(--muted)"), ("feedback call", "var(--ink)")])
    note = "The thin bar under each strip shows when the robot called: for attention, or for feedback."
    axis = f'<span></span><div class="axis">{ticks}</div>'
    return section("Who drove when", note, f'{colours}<div class="strips">{"".join(rows)}{axis}</div>')


def time_step(longest_s: float) -> int:
    """Distance of the marks on the time axis: at most six of them, at times that people count in."""
    return next((step for step in (1, 2, 5, 10, 15, 30, 60, 120, 300) if longest_s / step <= 6), 600)


def densities(run: Run) -> str:
    """Label densities by source (thesis, figure E.4)."""
    labels = run.labels()
    colours = "".join(
        [
            key(f"human ({plural(len(labels['human']), 'label')})", "var(--human)"),
            key(f"experts ({plural(len(labels['expert']), 'label')})", "var(--e3)"),
        ]
    )
    linear = plots.density(labels, 0, "Linear velocity", ("-1: full speed back", "1: full speed ahead"))
    angular = plots.density(labels, 1, "Angular velocity", ("-1: full right", "1: full left"))
    note = "Labels learned, by action, as a share of the robot's limits, and by who gave them (thesis, fig. E.4)."
    body = f'<div class="legend">{colours}</div><div class="pair">{linear}{angular}</div>'
    return section("What it learned from", note, body)


def pictures(run: Run) -> str:
    """What the camera saw when the robot called; evenly chosen when there are many."""
    calls = [(lap, step) for lap, step in run.steps() if step.image]
    chosen = calls
    if len(calls) > PICTURES:
        chosen = [calls[index * len(calls) // PICTURES] for index in range(PICTURES)]
    figures = []
    for lap, step in chosen:
        colour = "var(--ink)" if step.decision.call == Call.FEEDBACK else "var(--muted)"
        when = f"{step.decision.stamp_s - lap.began_s:.1f} s"
        figures.append(
            f'<figure style="--key:{colour}"><img alt="camera at a call" src="{png(step.image or b"")}">'
            f"<figcaption>{escape(step.decision.call)}<br>"
            f'<span class="muted">lap {lap.number}, {when}</span></figcaption></figure>'
        )
    note = f"The camera's 32x32 gray image, as the networks get it. {len(chosen)} of {plural(len(calls), 'call')}."
    if not figures:
        return section("What it saw when it called", "It never called.", "")
    return section("What it saw when it called", note, f'<div class="calls">{"".join(figures)}</div>')


def png(image: bytes) -> str:
    """Encode square gray pixels as a data URI."""
    side = math.isqrt(len(image))
    _, data = cv2.imencode(".png", np.frombuffer(image[: side * side], dtype=np.uint8).reshape(side, side))
    return "data:image/png;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def section(title: str, note: str, body: str) -> str:
    """A heading, one line on how to read what follows, and that."""
    return f'\n<h2>{escape(title)}</h2><p class="note">{escape(note)}</p>{body}'
