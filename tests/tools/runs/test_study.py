"""A study: balanced orders, blinded names, the table, what may be given away, the page, and a dry run of all of it."""

import dataclasses
import itertools
from pathlib import Path

import pytest
from short_trials import write_world

from lira.fusion.log.run_log import RunWriter, VerdictRecord
from lira.fusion.methods.presets import METHODS
from lira.hal.errors import ConfigError, StorageError
from lira.hal.profile import load_profile
from lira.tools.cli import main
from lira.tools.runs.plan import Plan
from lira.tools.study import script
from lira.tools.study.analysis import paired, render
from lira.tools.study.conduct import Study
from lira.tools.study.order import blinded, order, square
from lira.tools.study.plan import load_plan
from lira.tools.study.questions import SCALES, ask_all
from lira.tools.study.table import BlockRow, export, read_rows, write_rows

PLAN = """title = "T"
consent = "C"
methods = ["plus", "hg-dagger"]
world = "lane"
questions = ["Why"]
"""
NUMBERS = (True, 3, 3, 2, 0, 1, 40, 10, 7, 5, 4, 1, 0.5, 30.0, 200.0)
ROW = BlockRow("participant-001", 1, "plus", "B", *NUMBERS, *[20] * 6, 20.0, "said")


@pytest.mark.parametrize("count", range(2, 9))
def test_everything_is_at_every_place_and_follows_everything_equally_often(count):
    rows = square(count)
    for place in range(count):
        assert sorted(row[place] for row in rows) == sorted(list(range(count)) * (len(rows) // count))
    follows = [pair for row in rows for pair in itertools.pairwise(row)]
    assert len({follows.count(pair) for pair in set(follows)}) == 1
    assert len(set(follows)) == count * (count - 1)


def test_participants_take_the_rows_in_turn_and_names_do_not_tell_the_method():
    assert order(("a", "b"), 1) == ["a", "b"]
    assert order(("a", "b"), 2) == ["b", "a"]
    assert order(("a", "b"), 3) == order(("a", "b"), 1)
    shown = {blinded(("a", "b"), person, 0)["a"] for person in range(1, 20)}
    assert shown == {"A", "B"}
    assert blinded(("a", "b"), 4, 0) == blinded(("a", "b"), 4, 0)


def test_the_load_index_takes_numbers_and_asks_again_for_others():
    answers = iter(["much", "101", "40", "10", "20", "30", "50", "60", "since"])
    answered = ask_all(["Why"], lambda _: next(answers))
    assert list(answered.load) == list(SCALES)
    assert answered.total == 35.0
    assert answered.words == {"Why": "since"}


def test_a_table_comes_back_as_it_was_written(tmp_path):
    rows = [ROW, dataclasses.replace(ROW, place=2, reaction_s=None, passed=False)]
    assert read_rows(write_rows(tmp_path / "blocks.csv", rows)) == rows
    assert read_rows(tmp_path / "none.csv") == []
    (tmp_path / "bad.csv").write_text("a,b\n1,2\n")
    with pytest.raises(StorageError, match="no table"):
        read_rows(tmp_path / "bad.csv")


def test_what_is_given_away_names_nobody_and_keeps_people_apart(tmp_path):
    rows = [ROW, dataclasses.replace(ROW, place=2), dataclasses.replace(ROW, participant="participant-002")]
    text = export(tmp_path / "export.csv", rows).read_text()
    assert "participant-" not in text
    assert "said" not in text
    people = [line.split(",")[0] for line in text.splitlines()[1:]]
    assert len(set(people)) == 2


def test_differences_are_within_people_and_only_of_what_was_measured():
    other = dataclasses.replace(ROW, method="hg", human_labels=70, reaction_s=None)
    alone = dataclasses.replace(ROW, participant="participant-002")
    rows = [ROW, other, alone]
    assert paired(rows, "human_labels", ("plus", "hg")) == [30.0]
    assert paired(rows, "reaction_s", ("plus", "hg")) == []
    two = [dataclasses.replace(row, participant=name) for name in ("a", "b") for row in (ROW, other)]
    page = render("T", two)
    assert "hg - plus" in page
    assert "+30.0" in page


def test_a_plan_that_cannot_be_held_is_refused(tmp_path, capsys):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN.replace('"hg-dagger"', '"plus"'))
    with pytest.raises(ConfigError, match="twice"):
        load_plan(path)
    path.write_text(PLAN.replace("hg-dagger", "nothing"))
    with pytest.raises(ConfigError):
        load_plan(path)
    path.write_text(PLAN)
    assert main(["study", str(path), "--participant", "99", "--to", str(tmp_path / "s")]) == 2
    assert main(["study", str(path), "--analyse", "--to", str(tmp_path / "s")]) == 2
    capsys.readouterr()


def test_nobody_takes_part_who_does_not_agree(tmp_path, monkeypatch, capsys):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    monkeypatch.setattr("builtins.input", lambda _: "no")
    assert main(["study", str(path), "--participant", "1", "--to", str(tmp_path / "s")]) == 1
    assert not (tmp_path / "s").exists()
    capsys.readouterr()


def test_a_participant_reads_no_method_and_is_asked_for_consent_once(tmp_path):
    """The terminal, the words of a block's folder and its report: a letter, and nothing that tells which it is."""
    path, said, taught = tmp_path / "plan.toml", [], []
    path.write_text(PLAN + "practice_s = 5.0\nuntil_passed = false\n")
    study = Study(load_plan(path), tmp_path / "s", said.append)

    def teach(words):
        taught.append(words)
        head = Plan(METHODS[words[3]]).head(load_profile("thesis-sim"), "lane")
        with RunWriter(Path(words[words.index("--run") + 1]) / "run.jsonl") as record:
            record.write(head)
            record.write(VerdictRecord("participant-001", "It did not", False))
        return 1

    asked = []

    def ask(words):
        asked.append(words)
        return "yes" if "agree" in words else "50"

    assert [study.hold_next(1, teach, ask) for _ in range(2)] == [0, 0]
    with pytest.raises(ConfigError, match="every block"):
        study.hold_next(1, teach, ask)
    assert sum("agree" in words for words in asked) == 1
    assert "agreed: 20" in (tmp_path / "s" / "participant-001" / "consent.txt").read_text()
    shown = [words[words.index("--shown-as") + 1] for words in taught]
    assert sorted(shown) == ["A", "B"]
    assert "--whole-time" in taught[0]
    pages = [(study.block(1, place) / "report.html").read_text() for place in (1, 2)]
    for letter, page in zip(shown, pages, strict=True):
        assert f"Method {letter}" in page
    for words in [*said, *asked, *pages, *map(str, (tmp_path / "s").rglob("*"))]:
        assert not any(name in words.lower() for name in ("plus", "dagger", "lira teach")), words
    assert {row.method for row in read_rows(tmp_path / "s" / "blocks.csv")} == {"plus", "hg-dagger"}


def test_a_dry_run_leaves_the_table_a_folder_for_each_and_the_page(tmp_path, monkeypatch, capsys):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN.replace('"lane"', f'"{write_world(tmp_path)}"') + "unseen = 0\n")
    monkeypatch.setattr(script, "LAPS", 1)
    assert main(["study", str(path), "--dry-run", "--to", str(tmp_path / "s")]) == 0
    rows = read_rows(tmp_path / "s" / "blocks.csv")
    begin = [("1", 1, "plus"), ("1", 2, "hg-dagger"), ("2", 1, "hg-dagger")]
    assert [(row.participant[-1], row.place, row.method) for row in rows][:3] == begin
    assert len(rows) == 6
    assert all((tmp_path / "s" / row.participant / f"block-{row.place}" / "report.html").is_file() for row in rows)
    assert (tmp_path / "s" / "analysis.html").is_file()
    assert (tmp_path / "s" / "export.csv").is_file()
    capsys.readouterr()
