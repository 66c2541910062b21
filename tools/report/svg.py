"""Pieces of SVG. Colours are classes of the page's style sheet, so that one drawing serves light and dark."""

from collections.abc import Iterable, Sequence
from html import escape

Point = tuple[float, float]


def number(value: float) -> str:
    """Two decimals at most: centimetres in a top view, hundredths of a pixel elsewhere."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if value else "0"


def polyline(points: Iterable[Point], *, closed: bool = False) -> str:
    """Return path data through `points`."""
    data = "L".join(f"{number(x)} {number(y)}" for x, y in points)
    return f"M{data}{'Z' if closed else ''}" if data else ""


def dots(points: Iterable[Point]) -> str:
    """Path data of one dot per point (zero-length strokes: they need round caps)."""
    return "".join(f"M{number(x)} {number(y)}h0" for x, y in points)


def bars(spans: Iterable[tuple[float, float]], y: float) -> str:
    """Path data of horizontal bars from start to end at height `y`; the stroke's width makes them thick."""
    return "".join(f"M{number(start)} {number(y)}H{number(end)}" for start, end in spans)


def path(data: str, css: str, attributes: str = "") -> str:
    """One path, or nothing where there is nothing to draw."""
    return f'<path class="{css}" {attributes} d="{data}"/>' if data else ""


def text(at: Point, words: str, css: str) -> str:
    """One line of text."""
    return f'<text class="{css}" x="{number(at[0])}" y="{number(at[1])}">{escape(words)}</text>'


def drawing(box: tuple[float, float, float, float], parts: Sequence[str], label: str, *, attributes: str = "") -> str:
    """Wrap `parts` into an image with a name for screen readers; `box` is (x, y, width, height)."""
    view = " ".join(number(value) for value in box)
    return f'<svg viewBox="{view}" role="img" aria-label="{escape(label)}" {attributes}>{"".join(parts)}</svg>'
