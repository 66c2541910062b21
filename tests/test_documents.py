"""The documents lead somewhere: links, named files, commands, names and rows are there. Needs no site builder."""

import argparse
import ast
import importlib
import re
import shlex
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import lira
from lira.tools.stop_test.rows import ROWS
from lira.tools.verbs import VERBS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PACKAGES = ("hal", "robot", "sim_backend", "fusion", "tools")
FOLDERS = (*PACKAGES, "tests", "docs", "examples", ".ci", ".github")
PAGES = sorted([*DOCS.rglob("*.md"), *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "SECURITY"))])
PUBLIC = frozenset(lira.__all__)

CODE = sorted(
    path
    for folder in (*PACKAGES, "tests", "examples")
    for path in (ROOT / folder).rglob("*.*")
    if path.suffix in (".py", ".toml")
)
OTHERS = {"docs/design.md"}  # rmw_zenoh's

REAL_WHEELS = {"robot/core2/wheels.py", "tools/stop_test/journal.py:Wheels"}  # the robot's own


def shown(path: Path) -> str:
    return str(path.relative_to(ROOT))


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", read(page), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What can be linked to in a page: its headings, as the site builder and GitHub name them."""
    headings = re.findall(r"^#+ (.+)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def named_files(text: str) -> set[str]:
    """Files and folders of ours that a text names."""
    start = "|".join(re.escape(folder) for folder in FOLDERS)
    found = re.findall(rf"(?<![\w/.~-])((?:{start})/[\w./-]*\w)", text)
    return {name for name in found if (ROOT / name.split("/")[0]).exists()}


def remarks(path: Path) -> Iterator[str]:
    """The comments and docstrings of a Python file, the comments of a TOML file."""
    if path.suffix == ".toml":
        yield from re.findall(r"^ *#(.*)$", read(path), flags=re.MULTILINE)
        return
    with path.open(encoding="utf-8") as file:
        yield from (token.string for token in tokenize.generate_tokens(file.readline) if token.type == tokenize.COMMENT)
    for node in ast.walk(ast.parse(read(path))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""


def blocks(page: Path, *languages: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```", read(page), flags=re.MULTILINE | re.DOTALL)
    return [text for language, text in found if language in languages]


def commands(page: Path) -> list[list[str]]:
    lines = [line for block in blocks(page, "sh", "") for line in block.splitlines()]
    return [shlex.split(line, comments=True) for line in lines if re.match(r"(lira|make) ", line)]


def rows_of(text: str) -> list[list[str]]:
    """The rows of all tables in a text, as their cells."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_links_lead_to_a_page_and_a_heading(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if link.startswith(("http://", "https://")):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f"{shown(page)} links to {link}"
        assert not anchor or anchor in anchors(target), f"{shown(page)} links to {link}"
        on_site = not page.is_relative_to(DOCS) or target.is_relative_to(DOCS)
        assert on_site, f"{shown(page)} links to {link}, which the site has not: name the file"


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_files_that_are_named_are_there(page):
    missing = {name for name in named_files(read(page)) if not (ROOT / name).exists()}
    assert not missing


def test_files_that_a_comment_or_a_docstring_names_are_there():
    """By their place in the repository: `lira/` before it is that of an installation."""
    missing = set()
    for path in CODE:
        text = "\n".join(remarks(path))
        named = {name for name in named_files(text) - OTHERS if not (ROOT / name).exists()}
        named |= set(re.findall(rf"(?<![\w/.~-])lira/(?:{'|'.join(PACKAGES)})/[\w./-]*", text))
        missing |= {f"{shown(path)}: {name}" for name in named}
    assert not missing


def test_the_site_has_every_page_once_and_no_other():
    def pages(nav):
        for each in nav:
            for target in each.values():
                yield from [target] if isinstance(target, str) else pages(target)

    project = tomllib.loads(read(ROOT / "zensical.toml"))["project"]
    assert sorted(pages(project["nav"])) == sorted(str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_commands_are_understood(page, capsys):
    """Each is parsed, not run."""
    targets = re.findall(r"^([a-z-]+):", read(ROOT / "Makefile"), flags=re.MULTILINE)
    for program, name, *words in commands(page):
        if program == "make":
            assert name in targets, f"make {name}"
            continue
        if name.startswith("-"):
            continue
        assert name in VERBS, f"lira {name}"
        parser = argparse.ArgumentParser(prog=f"lira {name}", allow_abbrev=False)
        importlib.import_module(VERBS[name].module).add_arguments(parser)
        try:
            parser.parse_args(words)
        except SystemExit:
            pytest.fail(f"lira {shlex.join([name, *words])}: {capsys.readouterr().err}")


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_code_is_python_and_uses_names_of_the_public_api(page):
    for block in blocks(page, "python"):
        tree = ast.parse(block)
        used = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "lira"
        }
        assert used <= PUBLIC, f"{shown(page)} uses {used - PUBLIC}"


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "toml")], ids=shown)
def test_settings_are_toml(page):
    for block in blocks(page, "toml"):
        tomllib.loads(block)


# The safety case.


SAFETY = [row for row in rows_of(prose(DOCS / "safety-case.md")) if len(row) == 4 and quoted(row[1])]


def test_the_safety_case_has_a_mechanism_and_a_test_for_each_promise():
    assert len(SAFETY) >= 30
    for promise, mechanism, test, row in SAFETY:
        assert promise, mechanism
        assert all(name.endswith(".py") and (ROOT / name).is_file() for name in quoted(mechanism)), mechanism
        assert quoted(test), promise
        for name in quoted(test):
            file, _, function = name.partition("::")
            assert (ROOT / file).is_file(), name
            assert not function or f"def {function}(" in read(ROOT / file), name
        assert quoted(row) or row, promise


def test_the_rows_that_the_safety_case_names_are_those_of_the_stop_test():
    rows = {row.name for row in ROWS}
    named = {name for *_, cell in SAFETY for name in quoted(cell) if not name.startswith("lira ")}
    assert named <= rows, named - rows
    assert len(named) >= 0.75 * len(rows)


# The glossary.


GLOSSARY, NOT_USED = prose(DOCS / "glossary.md"), "## Words that are not used"


def words(name: str) -> set[str]:
    """The words of a module's or a class's name, in the singular."""
    return {word.lower().removesuffix("s") for word in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)}


def names() -> list[str]:
    """Every module and class, as PATH and PATH:CLASS."""
    found = []
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        found.append(shown(path))
        tree = ast.parse(read(path))
        found += [f"{shown(path)}:{node.name}" for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return found


def test_every_name_of_the_public_api_is_in_the_glossary():
    explained = {name for row in rows_of(GLOSSARY.partition(NOT_USED)[0]) for cell in row for name in quoted(cell)}
    assert explained >= PUBLIC, PUBLIC - explained


def test_no_name_has_a_word_that_is_not_used():
    banned = {word for row in rows_of(GLOSSARY.partition(NOT_USED)[2]) for word in quoted(row[0])}
    assert {"wheel", "watchman", "desk", "rig"} <= banned
    found = {name for name in names() if words(re.split("[/:]", name)[-1].removesuffix(".py")) & banned}
    assert found == REAL_WHEELS
