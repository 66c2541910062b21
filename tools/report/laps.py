"""The table of laps, the same on the page and in the terminal."""

from lira.tools.report.digest import Lap

COLUMNS = (
    *("lap", "layout", "passed", "without human", "time", "collisions", "line lost", "off line, rms"),
    *("human labels", "interventions", "calls", "labels learned", "training steps"),
)


def lap_cells(lap: Lap) -> list[str]:
    """One row: a text for each of `COLUMNS`."""
    record = lap.record
    if record is None:
        return [lap.title, str(lap.layout), "cut off", *[""] * (len(COLUMNS) - 3)]
    return [
        lap.title,
        str(record.layout),
        yes(record.passed),
        yes(record.unassisted),
        clock(record.duration_s),
        str(record.collisions),
        str(record.lost),
        "" if record.lateral_rms_m is None else f"{record.lateral_rms_m:.2f} m",
        *map(str, (record.human_labels, record.interventions, record.calls, record.buffer, record.training_steps)),
    ]


def yes(answer: bool) -> str:
    """Yes or no."""
    return "yes" if answer else "no"


def clock(seconds: float) -> str:
    """Minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
