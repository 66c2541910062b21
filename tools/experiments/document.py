"""RESULTS.md: every experiment's tables, what agrees with the thesis, what does not and the likely cause."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from lira.hal.config import load_toml, write_whole
from lira.hal.errors import ConfigError, StorageError
from lira.tools.bench import cell, columns
from lira.tools.experiments.experiment import Finding, Row
from lira.tools.experiments.fingerprint import ROOT
from lira.tools.experiments.summary import Summary

SUMMARIES = ROOT / "tools" / "experiments" / "results"
CAUSES = ROOT / "tools" / "experiments" / "causes.toml"
DOCUMENT = ROOT / "RESULTS.md"

HEAD = """# Results

The thesis's experiments on the twin, ours beside the thesis's. Made by a command from the summaries in
`tools/experiments/results/`, so do not edit it:

```
make results SEEDS=10 WORKERS=2     # plays every trial that is missing, writes the summaries and this page
lira experiment results             # this page alone, from the summaries that are there
```

Trials of one seed share the layout, the teacher's faults and the start of the networks, whatever the method. Numbers
are medians over the seeds unless a column says otherwise; intervals are 95 % bootstrap intervals of the median. A run
that met its cap of laps is censored: it counts with what it had used by then, and is never dropped.
`agrees` and `differs` are computed from the numbers; the likely causes are ours.

All experiments but `unseen` were played with the code of commit 00e2cd3 and have not been played again. Since then the
scripted teacher, who now and then drove the line the wrong way and taught it, has been mended: means far above their
medians are partly his, for every method. `plus` in them is the one of that commit: networks, with a memory of resolved
calls and an ensemble's confidence. Today's is told in [fusion/README.md](fusion/README.md).
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


def document(summaries: Sequence[Summary], causes: Mapping[str, str]) -> str:
    """Return the page in Markdown."""
    parts = [HEAD, "## Overview\n", table([overview(each) for each in summaries])]
    parts += [chapter(each, causes) for each in summaries]
    return "\n".join(parts)


def overview(summary: Summary) -> Row:
    """One line per experiment."""
    agrees = sum(finding.agrees for finding in summary.findings)
    return {
        "experiment": f"[{summary.name}](#{summary.name.lower()})",
        "shows": summary.words,
        "seeds": summary.seeds,
        "agrees": agrees,
        "differs": len(summary.findings) - agrees,
    }


def chapter(summary: Summary, causes: Mapping[str, str]) -> str:
    """Everything about one experiment."""
    parts = [f"\n## {summary.name}\n", f"{summary.words}. `{summary.command}`: {summary.trials} trials."]
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


def table(rows: Sequence[Row]) -> str:
    """A table in Markdown."""
    names = columns(rows)
    lines = [[name.replace("_", " ") for name in names], ["---"] * len(names)]
    lines += [[cell(row.get(name)).replace("|", "\\|") for name in names] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def write_document(path: Path, text: str) -> None:
    """Write the page. Raises `StorageError`."""
    write_whole(path, text.encode())
