"""The results as documents: RESULTS.md with what is asked of novices at equal quality, and a page per experiment."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from lira.hal.config import load_toml, write_whole
from lira.hal.errors import ConfigError, StorageError
from lira.hal.words import plural
from lira.tools.experiments.experiment import Finding, Row
from lira.tools.experiments.output.lead import LED_BY, NOT_YET, lead
from lira.tools.experiments.output.markdown import table
from lira.tools.experiments.output.summary import Summary
from lira.tools.experiments.playing.fingerprint import ROOT

SUMMARIES = ROOT / "tools" / "experiments" / "results"
CAUSES = ROOT / "tools" / "experiments" / "causes.toml"
DOCUMENT = (ROOT / "tools").resolve().parent / "RESULTS.md"  # beside the folders, which are links in the package
PAGES = "docs/results"  # beside the document

INDEX = """# Results of the thesis's experiments

The thesis's experiments on the twin, ours beside the thesis's. Made by a command from the summaries in
`tools/experiments/results/`, so do not edit these pages. What is asked of novices at equal quality, on layouts that
nobody taught them, is in `RESULTS.md`.

Trials of one seed share the layout, the teacher's faults and the start of the networks, whatever the method. Numbers
are medians over the seeds unless a column says otherwise; intervals are 95 % bootstrap intervals of the median. A run
that met its cap of laps is censored: it counts with what it had used by then, and is never dropped.
`agrees` and `differs` are computed from the numbers; the likely causes are ours.

A row says with which commit an experiment was played. In those of 00e2cd3 the scripted teacher now and then drove the
line the wrong way and taught it, so that means far above their medians are partly his, for every method; and `plus` in
them is networks, with a memory of resolved calls and an ensemble's confidence.

"""


def read_causes(path: Path = CAUSES) -> dict[str, str]:
    """Read the likely causes of differences by the findings they explain. Raises `StorageError`."""
    try:
        return load_toml(path, dict[str, str])
    except ConfigError as error:
        raise StorageError(f"{path} is not a list of causes: {error.what}", 'Lines are "KEY" = "words".') from error


def cause(key: str, causes: Mapping[str, str]) -> str | None:
    """Return the cause of a finding: its own, or that of the nearest part of its key, cut at the dots from the end."""
    parts = key.split(".")
    return next(
        (causes[prefix] for prefix in (".".join(parts[:n]) for n in range(len(parts), 0, -1)) if prefix in causes), None
    )


def documents(summaries: Sequence[Summary], causes: Mapping[str, str], name: str = DOCUMENT.name) -> dict[str, str]:
    """Return all documents in Markdown, by their paths: the first one is called `name`, the others lie beside it."""
    leading = [each for each in summaries if each.name.startswith(LED_BY)]
    others = [each for each in summaries if not each.name.startswith(LED_BY)]
    overviews = [overview(each, f"{each.name}.md") for each in others]
    linked = [overview(each, f"{PAGES}/{each.name}.md") for each in others]
    return {
        name: lead(summaries) + ("\n## The thesis's experiments\n\n" + table(linked) if others else ""),
        f"{PAGES}/index.md": INDEX + table(overviews),
        f"{PAGES}/{LED_BY}.md": "\n".join(chapter(each, causes) for each in leading) or f"# {LED_BY}\n{NOT_YET}",
        **{f"{PAGES}/{each.name}.md": chapter(each, causes) for each in others},
    }


def overview(summary: Summary, link: str) -> Row:
    """One line per experiment."""
    agrees = sum(finding.agrees for finding in summary.findings)
    return {
        "experiment": f"[{summary.name}]({link})",
        "shows": summary.words,
        "seeds": summary.seeds,
        "played with": summary.commit,
        "agrees": agrees,
        "differs": len(summary.findings) - agrees,
    }


def chapter(summary: Summary, causes: Mapping[str, str]) -> str:
    """Everything about one experiment."""
    parts = [f"# {summary.name}\n", f"{summary.words}. `{summary.command}`: {plural(summary.trials, 'trial')}."]
    for each in summary.tables:
        parts += [f"\n{each.title}:\n", table(each.rows)]
        parts += [each.note] if each.note else []
    parts += ["\nAgainst the thesis:\n"] if summary.findings else []
    parts += [verdict(finding, causes) for finding in summary.findings]
    return "\n".join(parts) + "\n"


def verdict(finding: Finding, causes: Mapping[str, str]) -> str:
    """One finding, with its cause where it differs."""
    line = f"- {finding.claim}. Thesis {finding.thesis}; ours {finding.ours}: "
    if finding.agrees:
        return line + "**agrees**."
    return line + f"**differs**. {cause(finding.key, causes) or 'Cause not known.'}"


def write_documents(out: Path, texts: Mapping[str, str]) -> None:
    """Write the pages into the folder of `out`. Raises `StorageError`."""
    for path, text in texts.items():
        write_whole(out.parent / path, text.encode(), folder=True)
