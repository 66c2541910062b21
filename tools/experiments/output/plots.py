"""The drawings of experiments. Without pyplot: a figure is a value, and no window system is asked for."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lira.hal.messages import Action
from lira.tools.experiments.experiment import Row
from lira.tools.experiments.notes import Track
from lira.tools.report.course import course
from lira.tools.report.plots import BINS, PUT_BACK_M

# Okabe and Ito: told apart by people with any colour vision.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d00", "#626b75")
AROUND_M = 1.0
THESIS_COLOUR = "#000000"


def boxes(groups: Mapping[str, Sequence[float]], censored: Mapping[str, Sequence[bool]], quantity: str) -> Figure:
    """Box plots with every run as a dot (figures 11 and 12); a run that did not converge is a cross."""
    figure = Figure(figsize=(1.3 + 1.3 * len(groups), 3.6), layout="constrained")
    axes = figure.subplots()
    axes.boxplot(list(groups.values()), tick_labels=list(groups), showfliers=False, medianprops={"color": COLOURS[1]})
    for place, (name, values) in enumerate(groups.items(), start=1):
        across = place + np.linspace(-0.15, 0.15, len(values)) if len(values) > 1 else np.array([place])
        cut = np.array(censored[name], dtype=bool)
        at = np.array(values, dtype=float)
        axes.plot(across[~cut], at[~cut], "o", color=COLOURS[0], alpha=0.7)
        axes.plot(across[cut], at[cut], "x", color=COLOURS[1])
    axes.set_ylabel(quantity)
    axes.set_ylim(bottom=0)
    axes.tick_params(axis="x", rotation=20)
    return figure


def intervals(rows: Sequence[Row], thesis: Mapping[str, float]) -> Figure:
    """Paired ratios with their intervals, one panel per quantity; the thesis's ratio is a dashed line."""
    quantities = list(dict.fromkeys(str(row["quantity"]) for row in rows))
    figure = Figure(figsize=(9, 1.2 + 0.3 * len(rows) / max(len(quantities), 1)), layout="constrained")
    panels = figure.subplots(1, len(quantities), sharey=True, squeeze=False)[0]
    for axes, quantity in zip(panels, quantities, strict=True):
        shown = [row for row in rows if row["quantity"] == quantity]
        names = [f"{row['against']} / {row['method']}" for row in shown]
        median, low, high = (np.array([float(str(row[key])) for row in shown]) for key in ("median", "low", "high"))
        axes.errorbar(median, np.arange(len(shown)), xerr=[median - low, high - median], fmt="o", color=COLOURS[0])
        axes.set_yticks(np.arange(len(shown)), names)
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.axvline(1.0, color="#9aa1a9", linewidth=0.8)
        if quantity in thesis:
            axes.axvline(thesis[quantity], color=THESIS_COLOUR, linestyle="--", label="thesis")
            axes.legend(loc="lower right")
        axes.set_xlabel(f"ratio, {quantity.replace('_', ' ')}")
    return figure


def curves(rows: Sequence[Row]) -> Figure:
    """Share passed against what it took, a step curve per method; the two levels of quality are dashed."""
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axes = figure.subplots()
    for index, name in enumerate(dict.fromkeys(str(row["method"]) for row in rows)):
        own = [row for row in rows if row["method"] == name]
        at, rate = ([float(str(row[key])) for row in own] for key in ("at", "share"))
        dashes = "-" if index < len(COLOURS) else ":"
        axes.plot(at, 100.0 * np.array(rate), dashes, marker="o", color=COLOURS[index % len(COLOURS)], label=name)
    for level in (90, 97):
        axes.axhline(level, color="#9aa1a9", linestyle="--", linewidth=0.8)
    axes.set_ylim(0, 102)
    axes.set_xlabel(str(rows[0]["quantity"]).replace("_", " ") if rows else "")
    axes.set_ylabel("fresh layouts passed, %")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def paired_bars(names: Sequence[str], series: Mapping[str, Sequence[float]], quantity: str) -> Figure:
    """Bars side by side, one group per name; zero-height bars of a logarithmic scale are left out."""
    figure = Figure(figsize=(2 + 1.1 * len(names), 3.4), layout="constrained")
    axes = figure.subplots()
    width = 0.8 / len(series)
    for index, (label, values) in enumerate(series.items()):
        colour = THESIS_COLOUR if label == "thesis" else COLOURS[index]
        axes.bar(
            np.arange(len(names)) + (index - (len(series) - 1) / 2) * width, values, width, label=label, color=colour
        )
    axes.set_xticks(np.arange(len(names)), names)
    axes.set_yscale("log")
    axes.set_ylabel(quantity)
    axes.legend()
    return figure


def densities(labels: Mapping[str, Sequence[Action]], per: int) -> Figure:
    """How many labels lie where on both axes of the action, by who gave them (figures E.4, E.5), per run of `per`."""
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for axis, (axes, words) in enumerate(zip(figure.subplots(1, 2), ("linear", "angular"), strict=True)):
        edges = np.linspace(-1.0, 1.0, BINS + 1)
        for index, (source, actions) in enumerate(labels.items()):
            counts, _ = np.histogram([action[axis] for action in actions], bins=edges)
            axes.stairs(counts / per, edges, fill=True, alpha=0.3, color=COLOURS[index])
            axes.stairs(counts / per, edges, color=COLOURS[index], label=f"{source} ({len(actions) / per:g})")
        axes.set_xlabel(f"{words} velocity, share of the robot's limit")
        axes.set_ylabel("labels per run")
        axes.legend()
    return figure


def top_view(world: str, tracks: Mapping[str, Track], full_speed_m_s: float) -> Figure:
    """Where laps went, one panel each, the colour for the speed; a long straight course is cut into three parts."""
    spans = [_span(track) for track in tracks.values()]
    long = max(right - left for left, right in spans) > 60.0
    parts = 3 if long else 1
    figure = Figure(figsize=(10, (1.5 if long else 4.0) * parts * len(tracks)), layout="constrained")
    panels = figure.subplots(len(tracks) * parts, 1, squeeze=False)[:, 0]
    drawn: LineCollection | None = None
    for index, (name, track) in enumerate(tracks.items()):
        left, right = spans[index]
        for part in range(parts):
            axes = panels[index * parts + part]
            drawn = _draw(axes, world, track, full_speed_m_s)
            axes.set_title(f"{name}, part {part + 1} of {parts}" if long else name, fontsize=9)
            if long:
                axes.set_ylim(min(track.y_mm) / 1000 - AROUND_M, max(track.y_mm) / 1000 + AROUND_M)
                axes.set_xlim(left + (right - left) * part / parts, left + (right - left) * (part + 1) / parts)
    if drawn is not None:
        figure.colorbar(drawn, ax=list(panels), label="speed, m/s", shrink=0.8)
    return figure


def _span(track: Track) -> tuple[float, float]:
    return min(track.x_mm, default=0) / 1000, max(track.x_mm, default=0) / 1000


def _draw(axes: Axes, world: str, track: Track, full_speed_m_s: float) -> LineCollection:
    floor = course(world, track.layout)
    if floor.line:
        axes.plot(*np.array(floor.line).T, color="#9aa1a9", linewidth=2, zorder=1)
    if floor.way:
        axes.plot(*np.array(floor.way).T, color="#9aa1a9", linewidth=0.8, linestyle="--", zorder=1)
    for shapes, colour in ((floor.marks, "#d9dde2"), (floor.boxes, "#3a4048"), (floor.hanging, "#8a6d00")):
        for outline in shapes:
            axes.fill(*np.array(outline).T, color=colour, zorder=2)
    xy = np.column_stack([track.x_mm, track.y_mm]) / 1000
    speed = np.array(track.speed_mm_s) / 1000
    pieces = np.stack([xy[:-1], xy[1:]], axis=1)
    near = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1) < PUT_BACK_M  # farther: it was put down anew
    drive = LineCollection(list(pieces[near]), array=speed[1:][near], cmap="viridis", linewidths=2, zorder=3)
    drive.set_clim(0.0, full_speed_m_s)
    axes.add_collection(drive)
    axes.scatter(xy[:, 0], xy[:, 1], c=speed, s=4, cmap="viridis", vmin=0.0, vmax=full_speed_m_s, zorder=4)
    axes.plot(*xy[0], "o", color="black", zorder=5)
    axes.set_aspect("equal")
    return drive
