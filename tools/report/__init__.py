"""The report of a run: one HTML file that needs nothing else."""

from pathlib import Path

from lira.hal.config import write_whole
from lira.tools.runs.names import RECORD

PAGE = "report.html"
COMPARISON = "comparison.html"


def write_report(folder: Path, shown_as: str = "") -> Path:
    """Make `report.html` from the `run.jsonl` in a run's folder and return its path.

    With `shown_as` it is for somebody who is not to know the method: by that letter, and without the command.
    Raises `StorageError` if there is no usable record, or the page cannot be written.
    """
    from lira.tools.report.digest import blinded, load_run
    from lira.tools.report.page import render

    page, run = folder / PAGE, load_run(folder / RECORD)
    write_whole(page, render(blinded(run, shown_as) if shown_as else run).encode())
    return page


def write_comparison(folders: tuple[Path, Path], page: Path) -> Path:
    """Make one page on two runs and return its path. Raises `StorageError` as `write_report` does."""
    from lira.tools.report.digest import load_run
    from lira.tools.report.pair import render_pair

    first, second = (load_run(folder / RECORD) for folder in folders)
    names = (folders[0].resolve().name, folders[1].resolve().name)
    write_whole(page, render_pair((first, second), names).encode())
    return page
