"""`lira new`: what it writes has tests that pass, and a name that is found."""

import os
import subprocess
import sys
import tomllib

import pytest

from lira.fusion.preprocess import MODALITIES
from lira.hal import plugins
from lira.hal.plugins import Door
from lira.tools.cli import main
from lira.tools.verbs.teach.new import KINDS


@pytest.fixture
def project(tmp_path, capsys):
    """Write a project; return its folder and what is said."""

    def write(kind, name):
        assert main(["new", kind, name, "--into", str(tmp_path)]) == 0
        return tmp_path / name, capsys.readouterr().out

    return write


def test_its_tests_pass_as_they_are_written(project):
    folders = []
    for kind in KINDS:
        folder, said = project(kind, f"my-{kind}")
        assert "python -m pytest" in said
        assert "$" not in "".join(path.read_text() for path in folder.rglob("*.*") if path.is_file())
        folders.append(folder)
    found = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-W",
        "error",
        "-p",
        "no:cacheprovider",
        "--import-mode",
        "importlib",
    ]
    # Each as its owner would, but in one process: its folder is the first place where Python looks.
    path = os.pathsep.join(map(str, folders))
    done = subprocess.run(
        [*found, *map(str, folders)],
        cwd=folders[0].parent,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[-4]) >= len(KINDS), done.stdout  # N passed in S


@pytest.mark.parametrize("kind", [kind for kind, about in KINDS.items() if about.door])
def test_the_entry_point_names_what_is_there(project, monkeypatch, kind):
    folder, _ = project(kind, f"a-{kind}")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(plugins, "_owners", {})
    (points,) = tomllib.loads((folder / "pyproject.toml").read_text())["project"]["entry-points"].items()
    door, entries = points
    assert door == f"lira.{KINDS[kind].door}"
    assert callable(Door(kind, door).find(entries[f"a-{kind}"], {}))


def test_it_is_formatted_as_a_linter_wants_it(project):
    lint = [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length", "120", "--select", "E,F,I,UP,B"]
    for kind in KINDS:
        folder, _ = project(kind, f"neat-{kind}")
        done = subprocess.run(lint, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", ["class", "My Wall", "3walls", "Wall", ""])
def test_a_name_that_can_be_no_module_is_refused(tmp_path, capsys, name):
    assert main(["new", "expert", name, "--into", str(tmp_path / "there")]) == 2
    assert "cannot be the name of a module" in capsys.readouterr().err
    assert not (tmp_path / "there").exists()


def assert_taken(tmp_path, capsys, kind, name, words):
    """It is refused with these words, another name is proposed, and nothing is made."""
    assert main(["new", kind, name, "--into", str(tmp_path / "there")]) == 2
    what, remedy = capsys.readouterr().err.splitlines()
    assert what == f"lira new: there is a {words}"
    assert f"such as my-{name}" in remedy
    assert not (tmp_path / "there").exists()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "name", ["json", "lira", "numpy", "torch", "zenoh", "cv2", "ruamel", "hypothesis", "eclipse-zenoh"]
)
def test_a_name_that_would_hide_what_is_installed_is_refused(tmp_path, capsys, kind, name):
    words = f"module or a package '{name}' already, which yours would hide"
    assert_taken(tmp_path, capsys, kind, name, words)


def test_what_is_not_installed_but_would_be_used_is_refused_too(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "path", [])
    assert main(["new", "expert", "torch", "--into", str(tmp_path / "there")]) == 2
    assert "there is a module or a package 'torch' already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("expert", "lidar"),
        ("expert", "depth-expert"),
        ("method", "plus"),
        ("method", "hg-dagger"),
        ("method", "hold-kernel"),
        ("robot", "rosbot2"),
        ("robot", "thesis-sim"),
        ("world", "line"),
        ("world", "table-top"),
    ],
)
def test_a_name_of_the_projects_own_is_refused(tmp_path, capsys, kind, name):
    assert_taken(tmp_path, capsys, kind, name, f"{kind} '{name}' already, which comes with the project")


def test_another_kind_may_have_that_name(project):
    for kind, name in (("world", "plus"), ("expert", "line"), ("sensor", "rosbot2")):
        assert project(kind, name)[0].is_dir()


def test_a_new_sensor_is_told_all_that_a_robot_can_learn_from(project):
    told = (project("sensor", "my-ranger")[0] / "README.md").read_text()
    assert all(f"`{name}`" in told for name in (*MODALITIES, "inputs"))


def test_what_is_there_is_left_alone(project, tmp_path, capsys):
    folder, _ = project("world", "mine")
    (folder / "mine.toml").write_text("mine")
    assert main(["new", "world", "mine", "--into", str(tmp_path)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert (folder / "mine.toml").read_text() == "mine"


def test_a_folder_that_cannot_be_written_is_one_clear_error(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["new", "expert", "wall", "--into", str(tmp_path / "file")]) == 2
    assert "cannot write" in capsys.readouterr().err
