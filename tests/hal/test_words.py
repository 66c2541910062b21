"""Numbers and their nouns: one of them is one label, and not one labels."""

import re
from pathlib import Path

import pytest

from lira.hal.words import plural

ROOT = Path(__file__).parents[2]
COUNTED = "labels|laps|layouts|trials|runs|steps|calls|interventions|messages|episodes|decisions|days|stops"
UNASKED = re.compile(rf"(?<!of )(?<!these )\{{[^{{}}:]+\}} (?:[a-z]+ )?(?:{COUNTED})\b")


@pytest.mark.parametrize(
    ("count", "noun", "words"),
    [
        (1, "training lap", "1 training lap"),
        (0, "label", "0 labels"),
        (2, "label", "2 labels"),
        (1, "box", "1 box"),
        (3, "box", "3 boxes"),
    ],
)
def test_a_noun_is_as_its_number_asks(count, noun, words):
    assert plural(count, noun) == words


@pytest.mark.parametrize("package", ["tools", "fusion"])
def test_what_is_counted_is_said_by_it(package):
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in (ROOT / package).rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if UNASKED.search(line)
    ]
    assert found == []
