"""The report of a run: one HTML file that needs nothing else."""

from pathlib import Path

from hal.errors import StorageError

RECORD = "run.jsonl"
PAGE = "report.html"


def write_report(folder: Path) -> Path:
    """Make `report.html` from the `run.jsonl` in a run's folder and return its path.

    Raises `StorageError` if there is no usable record, or the page cannot be written.
    """
    from tools.report.digest import load_run
    from tools.report.page import render

    page, part = folder / PAGE, folder / f"{PAGE}.part"
    text = render(load_run(folder / RECORD))
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(page)
    except OSError as error:
        raise StorageError(f"cannot write {page}: {error.strerror}", "Free some space or mend the rights.") from error
    return page
