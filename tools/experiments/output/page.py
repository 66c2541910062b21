"""One self-contained HTML page per experiment, and its drawings as files."""

import base64
import io
from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path

import matplotlib as mpl

from lira.hal.errors import StorageError
from lira.hal.words import plural
from lira.tools.bench import cell, columns
from lira.tools.experiments.experiment import Finding, Picture, Row
from lira.tools.experiments.output.summary import Summary
from lira.tools.report.page import section

mpl.rcParams["svg.hashsalt"] = "lira"  # the same data, the same file


def write_page(folder: Path, summary: Summary, pictures: Sequence[Picture]) -> Path:
    """Write `NAME.html` and `NAME-PICTURE.png` and `.svg` into the folder; return the page. Raises `StorageError`."""
    figures = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for picture in pictures:
            png, svg = render(picture)
            (folder / f"{summary.name}-{picture.name}.png").write_bytes(png)
            (folder / f"{summary.name}-{picture.name}.svg").write_bytes(svg)
            figures.append(figure(picture, svg))
        page = folder / f"{summary.name}.html"
        page.write_text(document(summary, figures), encoding="utf-8")
    except OSError as error:
        raise StorageError(
            f"cannot write into {folder}: {error.strerror}", "Free some space or choose --run."
        ) from error
    return page


def render(picture: Picture) -> tuple[bytes, bytes]:
    """Draw as PNG and as SVG."""
    drawn = picture.draw()
    files = {"png": io.BytesIO(), "svg": io.BytesIO()}
    for kind, file in files.items():
        drawn.savefig(file, format=kind, dpi=120, metadata={"Date": None} if kind == "svg" else None)
    return files["png"].getvalue(), files["svg"].getvalue()


def figure(picture: Picture, svg: bytes) -> str:
    """Embed a drawing; as an image, so that no two drawings share the names of their parts."""
    data = base64.b64encode(svg).decode("ascii")
    words = escape(picture.words)
    image = f'<img style="max-width:100%;background:#fff" alt="{words}" src="data:image/svg+xml;base64,{data}">'
    return f"<figure>{image}<figcaption>{words}</figcaption></figure>"


def document(summary: Summary, figures: Sequence[str]) -> str:
    """Return the whole page."""
    name = summary.name
    facts = f"{summary.command}: {plural(summary.trials, 'trial')}"
    style = (resources.files("lira.tools") / "report" / "page.css").read_text(encoding="utf-8")
    parts = [f'<h1>{escape(name)}: {escape(summary.words)}</h1><p class="muted">{escape(facts)}</p>']
    parts += [section(table.title, table.note, html_table(table.rows)) for table in summary.tables]
    if summary.findings:
        parts.append(section("Against the thesis", "", html_table([finding_row(each) for each in summary.findings])))
    if figures:
        parts.append(section("Drawings", "", "".join(figures)))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(name)}</title><style>{style}</style></head>\n<body>{''.join(parts)}</body></html>\n"
    )


def finding_row(finding: Finding) -> Row:
    """A finding as a row: the verdict in words."""
    return {
        "claim": finding.claim,
        "thesis": finding.thesis,
        "ours": finding.ours,
        "verdict": "agrees" if finding.agrees else "differs",
    }


def html_table(rows: list[Row]) -> str:
    """Rows under their columns."""
    names = columns(rows)
    header = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell(row.get(name)))}</td>" for name in names) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table><tr>{header}</tr>{body}</table></div>'
