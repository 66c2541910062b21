"""Every verb that is given a file or a folder: what is wrong with it is told first, with a remedy, and nothing is left.

First: before a robot is looked for, a process started or a folder made. The table names each argument of each verb that
is read; another test holds it to the verbs' parsers.
"""

import argparse
import importlib
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from lira.tools.cli import main
from lira.tools.verbs import VERBS

ROBOT = ["--", "--base", "b", "--without", "lidar", "--without", "camera"]
BASE = ["robot", "--base", "b", "--without", "lidar", "--without", "camera"]
TOML, POLICY, LOG, MCAP = ".toml", ".safetensors", ".lira", ".mcap"
FOLDER = ""  # wanted is a folder

# What is read, with the suffix that it has; {} is the path.
READ = {
    "demo --world": (["demo", "--world", "{}"], TOML),
    "demo --profile": (["demo", "--profile", "{}"], TOML),
    "teach --world": (["teach", "--world", "{}"], TOML),
    "teach --profile": (["teach", "--profile", "{}"], TOML),
    "teach --experts": (["teach", "--experts", "{}"], FOLDER),
    "study plan": (["study", "{}", "--dry-run"], TOML),
    "twin --world": (["twin", "--world", "{}"], TOML),
    "twin --profile": (["twin", "--profile", "{}"], TOML),
    "robot --profile": ([*BASE, "--profile", "{}"], TOML),
    "robot --settings": ([*BASE, "--settings", "{}"], TOML),
    "ros2 --image": (["ros2", "--connect", "127.0.0.1:1", "--image", "{}"], TOML),
    "ros2 --profile": (["ros2", "--connect", "127.0.0.1:1", "--profile", "{}"], TOML),
    "calibrate --profile": (["calibrate", "base", "--base", "b", "--settings", "s.toml", "--profile", "{}"], TOML),
    "parity --world": (["parity", "--world", "{}"], TOML),
    "parity --profile": (["parity", "--profile", "{}"], TOML),
    "parity --settings": (["parity", "--settings", "{}"], TOML),
    "fusion --experts": (["fusion", "--method", "plus", "--experts", "{}"], FOLDER),
    "drive policy": (["drive", "{}"], POLICY),
    "drive --experts": (["drive", "camera-expert", "--experts", "{}"], FOLDER),
    "train-expert --profile": (["train-expert", "camera", "--profile", "{}"], TOML),
    "experiment --experts": (["experiment", "unseen", "--experts", "{}"], FOLDER),
    "experiment --world": (["experiment", "unseen", "--world", "{}"], TOML),
    "labels file: list": (["labels", "list", "{}"], LOG),
    "labels file: undo": (["labels", "undo", "{}"], LOG),
    "labels file: explain": (["labels", "explain", "{}", "--number", "1"], LOG),
    "labels file: merge": (["labels", "merge", "{}", "other.lira", "-o", "c.lira"], LOG),
    "labels file: check": (["labels", "check", "{}"], LOG),
    "labels --profile": (["labels", "check", "other.lira", "--profile", "{}"], TOML),
    "joystick --pad": (["joystick", "--pad", "{}"], TOML),
    "view file": (["view", "{}"], MCAP),
    "world name": (["world", "{}", "--picture", "a.png"], TOML),
    "world --profile": (["world", "line", "--picture", "a.png", "--profile", "{}"], TOML),
    "record --recover": (["record", "--recover", "{}"], MCAP),
    "play file": (["play", "{}"], MCAP),
    "info file": (["info", "{}"], MCAP),
    "explain file": (["explain", "{}"], MCAP),
    "rerun file": (["rerun", "{}"], MCAP),
    "export file": (["export", "csv", "{}", "out.csv"], MCAP),
    "export file: onnx": (["export", "onnx", "{}", "out.onnx"], POLICY),
    "import file": (["import", "{}", "--run", "warm"], FOLDER),
    "import --profile": (["import", "bag", "--run", "warm", "--profile", "{}"], TOML),
    "report run": (["report", "{}"], FOLDER),
    "up --world": (["up", "--world", "{}"], TOML),
    "up --profile": (["up", "--profile", "{}"], TOML),
    "up --policy": (["up", "--policy", "{}"], POLICY),
    "deploy laptop --world": (["deploy", "laptop", "--dry-run", "--world", "{}"], TOML),
    "deploy laptop --profile": (["deploy", "laptop", "--dry-run", "--profile", "{}"], TOML),
    "deploy laptop --policy": (["deploy", "laptop", "--dry-run", "--policy", "{}"], POLICY),
    "deploy laptop --keys": (["deploy", "laptop", "--dry-run", "--keys", "{}"], FOLDER),
    "deploy robot --wheels": (["deploy", "robot", "--dry-run", "--wheels", "{}", *ROBOT], FOLDER),
    "deploy robot --keys": (["deploy", "robot", "--dry-run", "--keys", "{}", *ROBOT], FOLDER),
    "keys enroll folder": (["keys", "enroll", "anna", "{}"], FOLDER),
    "keys renew folder": (["keys", "renew", "anna", "{}"], FOLDER),
    "keys revoke folder": (["keys", "revoke", "anna", "{}"], FOLDER),
    "keys show folder": (["keys", "show", "{}"], FOLDER),
    "doctor --profile": (["doctor", "--lidar", "l", "--profile", "{}"], TOML),
    "doctor --settings": (["doctor", "--camera", "c", "--settings", "{}"], TOML),
    "stop-test --profile": (["stop-test", "--profile", "{}"], TOML),
}
SETTINGS = ("robot --settings", "parity --settings", "doctor --settings")  # an empty file is all defaults

# What is written, made or gone on with, and what is no file of this machine's or of ours.
WRITTEN = {
    "demo --run",
    "teach --run",
    "study --to",
    "new --into",
    "twin --wire",
    "msgs out",
    "calibrate --settings",
    "parity --json",
    "parity --out",
    "fusion --run",
    "train-expert --out",
    "experiment --run",
    "experiment --json",
    "experiment --summaries",
    "experiment --out",
    "labels --output",
    "labels --json",
    "joystick --learn",
    "console --screenshot",
    "web --screenshot",
    "view --rerun",
    "view --layout",
    "world --picture",
    "record --out",
    "record --run",
    "info --json",
    "explain --out",
    "explain --json",
    "rerun --page",
    "rerun --json",
    "export out",
    "import --run",
    "report --to",
    "up --run",
    "deploy laptop --run",
    "keys init folder",
    "doctor --out",
    "doctor --json",
    "stop-test --json",
    "bench --json",
    "bench --history",
}
AFTER_ANOTHER = {"export --labels"}  # is read when the recording is, which has to be one
NOT_OURS = {
    "twin --ros2-keys",
    "robot --ros2-keys",
    "robot --camera",
    "robot --openni",
    "doctor --camera",
    "doctor --openni",
    "deploy robot --ssh-config",
    "joystick --device",
    "doctor --device",
    "doctor --base",
    "doctor --lidar",
}
FLAGS = {"demo --no-record", "teach --no-record", "fusion --no-record", "labels --repair", "view --speed"}
NAMES = {"parity robots", "bench name", "robot --driver", "joystick --rules", "record --split"}  # no files either


def missing(path: Path) -> None:
    """Nothing is there."""


def a_folder(path: Path) -> None:
    """An empty one."""
    path.mkdir()


def empty(path: Path) -> None:
    """A file without a byte."""
    path.touch()


def other(path: Path) -> None:
    """A file of another kind."""
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 8)


@pytest.fixture
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which nothing is, and from which no process is started."""

    def refuse(*_: object, **__: object) -> None:
        pytest.fail("a process was started")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(os, "posix_spawn", refuse)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    return here


def there(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize("fault", [missing, a_folder, empty, other], ids=lambda fault: fault.__name__)
@pytest.mark.parametrize("name", READ)
def test_what_is_wrong_with_a_file_is_told_first_with_a_remedy_and_nothing_is_left(name, fault, alone, capsys):
    words, suffix = READ[name]
    if fault is empty and name in SETTINGS:
        return
    path = Path(f"nope{suffix}")
    fault(path)
    before = there(alone.parent)
    status = main([word.format(path) for word in words])
    out, err = capsys.readouterr()
    assert status == 2, out + err
    what, remedy = err.splitlines()
    assert "nope" in what
    assert re.fullmatch(r"  \S.*[.:?)]\S*|  .*lira .*", remedy), remedy
    for raw in ("PosixPath", "Errno", "Traceback", "Error("):
        assert raw not in err
    assert there(alone.parent) == before


FOLDERS = (
    ["demo", "--run", "{}"],
    ["teach", "--run", "{}"],
    ["fusion", "--method", "plus", "--run", "{}"],
    ["record", "--out", "{}"],
    ["record", "--run", "{}"],
    ["up", "--run", "{}"],
    ["deploy", "laptop", "--dry-run", "--run", "{}"],
    ["twin", "--wire", "{}"],
    ["msgs", "{}"],
    ["new", "expert", "wall", "--into", "{}"],
    ["keys", "init", "{}"],
)


@pytest.mark.parametrize("below", ["", "/below"], ids=["file", "below"])
@pytest.mark.parametrize("words", FOLDERS, ids=" ".join)
def test_a_folder_that_cannot_be_made_is_told_before_a_robot_is_looked_for(words, below, alone, capsys):
    Path("nope").touch()
    before = there(alone.parent)
    assert main([word.format(f"nope{below}") for word in words]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert "nope" in what
    assert "hoose another" in remedy
    assert there(alone.parent) == before


def arguments(verb: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.Action]]:
    """Every argument of a verb, by the verb and the longest way to write it."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                yield from arguments(f"{verb} {name}", sub)
        else:
            yield f"{verb} {max(action.option_strings, key=len, default=action.dest)}", action


def is_file(action: argparse.Action) -> bool:
    told = f"{action.metavar or ''} {action.help or ''}".lower()
    return action.type is Path or any(word in told for word in ("file", "folder", ".toml", ".safetensors", "/dev/"))


def test_every_argument_that_is_a_file_stands_in_a_table():
    found = set()
    for verb, row in VERBS.items():
        parser = argparse.ArgumentParser(verb)
        importlib.import_module(row.module).add_arguments(parser)
        found |= {name for name, action in arguments(verb, parser) if is_file(action)}
    read = {name.partition(":")[0] for name in READ}
    known = read | AFTER_ANOTHER | WRITTEN | NOT_OURS | FLAGS | NAMES
    assert sorted(found - known) == []
    assert found >= WRITTEN


@pytest.mark.parametrize("words", [["drive", "nope"], ["up", "--policy", "nope"], ["fusion", "--method", "nope"]])
def test_a_name_that_nobody_knows_is_told_before_a_robot_is_looked_for(words, alone, capsys):
    assert main(words) == 2
    assert "'nope'" in capsys.readouterr().err
