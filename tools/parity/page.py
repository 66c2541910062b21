"""The page of a comparison: the table, step responses, ages, scans and pictures. One file that needs nothing else."""

import base64
import math
from collections.abc import Callable, Sequence
from html import escape
from importlib import resources

import cv2
import numpy as np

from lira.tools.parity.compare import DIFFERS, Row, cells
from lira.tools.parity.record import Recording
from lira.tools.parity.sight import still_image, still_scan
from lira.tools.report.svg import Point, dots, drawing, path, polyline, text

COLUMNS = ("", "unit", "first", "second", "difference", "allowed", "verdict")
STYLES = ("novice", "human")  # of the first and the second robot: colours of the report's style sheet
LEFT, RIGHT, TOP, BOTTOM = 44.0, 740.0, 26.0, 186.0
PICTURE_PX = 256

Curve = Callable[[Recording], list[Point]]


def render(first: Recording, second: Recording, rows: Sequence[Row]) -> str:
    """Return the whole page."""
    pair = (first, second)
    title = f"{first.name} and {second.name}"
    style = (resources.files("lira.tools") / "report" / "page.css").read_text(encoding="utf-8")
    apart = [row.name for row in rows if row.verdict == DIFFERS]
    outcome = "No difference beyond what is allowed" if not apart else f"{len(apart)} of {len(rows)} lines differ"
    keys = "".join(
        f'<span style="--key:var(--{css})">{escape(each.name)} ({escape(each.profile.name)})</span>'
        for css, each in zip(STYLES, pair, strict=True)
    )
    head = "".join(f"<th>{escape(name)}</th>" for name in COLUMNS)
    body = "".join(table_row(row) for row in rows)
    charts = [
        chart(pair, lambda each: odometry(each, "linear_m_s"), "Speed, m/s, over the script's seconds"),
        chart(pair, lambda each: odometry(each, "angular_rad_s"), "Turn rate, rad/s"),
        chart(pair, lambda each: ages(each, "scan"), "Age of scans when they came, s"),
        chart(pair, lambda each: ages(each, "image"), "Age of pictures, s"),
        chart(pair, lambda each: ages(each, "odom"), "Age of odometry, s"),
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head>\n<body><h1>{escape(title)}</h1>"
        f'<p class="outcome {"bad" if apart else "good"}">{escape(outcome)}</p>'
        f'<div class="legend">{keys}</div>'
        f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'
        f"<h2>The same script of motions</h2>{''.join(charts)}"
        f'<h2>What they see from one place</h2><div class="views">{scans(pair)}{pictures(pair)}</div></body></html>\n'
    )


def table_row(row: Row) -> str:
    """One line of the table."""
    *values, verdict = cells(row)
    css = ' class="bad"' if row.verdict == DIFFERS else ""
    return f"<tr>{''.join(f'<td>{escape(value)}</td>' for value in values)}<td{css}>{escape(verdict)}</td></tr>"


def odometry(recording: Recording, name: str) -> list[Point]:
    """A speed over the time since the script began."""
    began_s = recording.spans[0].began_s
    return [(heard.message.stamp_s - began_s, getattr(heard.message, name)) for heard in recording.odom]


def ages(recording: Recording, topic: str) -> list[Point]:
    """The age of each message when it came, over the time since the script began."""
    began_s = recording.spans[0].began_s
    return [(heard.at_s - began_s, heard.at_s - heard.message.stamp_s) for heard in getattr(recording, topic)]


def chart(pair: Sequence[Recording], curve: Curve, title: str) -> str:
    """Both robots' values over time."""
    curves = [curve(each) for each in pair]
    points = [point for line in curves for point in line]
    if not points:
        return ""
    end_s = max(span.ended_s - each.spans[0].began_s for each in pair for span in each.spans[-1:])
    low, high = min(0.0, *(value for _, value in points)), max(0.0, *(value for _, value in points))
    if high - low < 1e-6:
        low, high = low - 0.5, high + 0.5

    def at(point: Point) -> Point:
        x = LEFT + min(max(point[0] / end_s, 0.0), 1.0) * (RIGHT - LEFT)
        return x, BOTTOM - (point[1] - low) / (high - low) * (BOTTOM - TOP)

    parts = [text((LEFT, 14), title, "heading")]
    for value in sorted({low, 0.0, high}):
        parts.append(path(polyline([at((0.0, value)), at((end_s, value))]), "grid"))
        parts.append(text((LEFT - 6, at((0.0, value))[1] + 4), f"{value:.2g}", "tick end"))
    for span in pair[0].spans:
        began_s = span.began_s - pair[0].spans[0].began_s
        parts.append(path(polyline([at((began_s, low)), at((began_s, high))]), "grid"))
        if not span.phase.name.endswith("stop"):
            parts.append(text((at((began_s, low))[0] + 3, BOTTOM + 14), span.phase.name, "tick"))
    for css, line in zip(STYLES, curves, strict=True):
        parts.append(path(polyline(map(at, line)), f"track s-{css}"))
        parts.append(path(dots(map(at, line)), f"steps s-{css}"))
    return drawing((0, 0, RIGHT + 16, BOTTOM + 22), parts, title)


def scans(pair: Sequence[Recording]) -> str:
    """Both scans from above, the robot's x to the right."""
    parts, reach_m = [], 1.0
    for css, each in zip(STYLES, pair, strict=True):
        seen = still_scan(each)
        if seen is None:
            continue
        bearings, ranges = (
            values[np.isfinite(seen[1]) & (seen[1] < each.profile.lidar.range_max_m)] for values in seen
        )
        points = list(zip((ranges * np.cos(bearings)).tolist(), (ranges * np.sin(bearings)).tolist(), strict=True))
        reach_m = max(reach_m, *(max(abs(x), abs(y)) for x, y in points)) if points else reach_m
        parts.append(path(dots(points), f"steps s-{css}"))
    size_m = 1.1 * reach_m
    arrow = path(polyline([(0.0, 0.0), (0.1 * reach_m, 0.0)]), "crash")
    drawn = drawing(
        (-size_m, -size_m, 2 * size_m, 2 * size_m), ['<g transform="scale(1 -1)">', *parts, arrow, "</g>"], "Both scans"
    )
    return f'<figure><div class="view">{drawn}</div><figcaption>scans; the line points ahead</figcaption></figure>'


def pictures(pair: Sequence[Recording]) -> str:
    """The two pictures as the networks see them, side by side."""
    figures = []
    for each in pair:
        image = still_image(each)
        if image is None:
            continue
        scale = math.ceil(PICTURE_PX / image.shape[0])
        gray = np.rint(image * 255).astype(np.uint8)
        data = cv2.imencode(".png", np.repeat(np.repeat(gray, scale, axis=0), scale, axis=1))[1].tobytes()
        source = f"data:image/png;base64,{base64.b64encode(data).decode()}"
        figures.append(
            f'<figure><img src="{source}" alt="what it sees"><figcaption>{escape(each.name)}</figcaption></figure>'
        )
    return "".join(figures)
