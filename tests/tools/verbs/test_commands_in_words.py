"""Every command that a help or a page shows is one that its verb takes: options, choices and counts of arguments."""

import argparse
import importlib
import re
import shlex
from pathlib import Path

import pytest

from lira.tools.verbs import VERBS

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "tools").glob("*/README.md"))]
PAGES += [ROOT / name / "README.md" for name in ("hal", "fusion", "robot", "sim_backend")]
COMMENT = re.compile(r"\s{2,}\S.*$|\s+#.*$")  # what stands behind a command, after two spaces or a #


def commands(text: str) -> list[str]:
    """Lines that are a command of ours, without what is said about it; a line that ends in \\ goes on."""
    lines = (COMMENT.sub("", line.strip()) for line in text.replace("\\\n", " ").splitlines())
    return [line for line in lines if line.split(" ")[0] == "lira" and len(line.split()) > 1]


def shown_by(page: Path) -> list[str]:
    blocks = re.findall(r"^```(?:sh|bash|console|)\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M)
    return [line for block in blocks for line in commands(block)]


def refused(line: str) -> str:
    """What the verb's parser says against a command; "" if it takes it, or somebody has to fill it in."""
    if any(mark in line for mark in ("...", "…", "<", "VERB", "-->")):
        return ""
    verb, *words = shlex.split(re.sub(r"\$\w+|\$\(.*?\)", "x", line).partition(" ")[2])
    words = words[: next((k for k, word in enumerate(words) if word in ("|", "&&", "&", ";", ">")), len(words))]
    if verb.startswith("-"):
        return ""
    if verb not in VERBS:
        return f"{line}: no verb"
    parser = argparse.ArgumentParser(verb, allow_abbrev=False, exit_on_error=False)
    importlib.import_module(VERBS[verb].module).add_arguments(parser)
    try:
        parser.parse_args(words)
    except (argparse.ArgumentError, SystemExit) as error:
        return "" if {"-h", "--help"} & set(words) else f"{line}: {error}"
    return ""


@pytest.mark.parametrize("verb", VERBS)
def test_the_examples_of_a_help_are_taken(verb):
    lines = commands(importlib.import_module(VERBS[verb].module).__doc__ or "")
    assert [words for line in lines if (words := refused(line))] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_commands_on_a_page_are_taken(page):
    assert [words for line in shown_by(page) if (words := refused(line))] == []


def test_a_command_that_its_verb_does_not_take_is_noticed():
    assert commands("  lira drive camera-expert --speed 2      faster") == ["lira drive camera-expert --speed 2"]
    assert "--speed" in refused("lira drive camera-expert --speed 2") or refused("lira drive a --speed 2")
    assert refused("lira fly")
    assert not refused("lira status --name second && echo up")
