"""What a deployment would write and run, and that systemd takes it."""

import argparse
import importlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

from lira.hal.bus.endpoint import is_loopback
from lira.hal.errors import ConfigError
from lira.tools.authority import init
from lira.tools.cli import main
from lira.tools.deploy import packages, units
from lira.tools.deploy.plan import SECRET, File, Plan, removal
from lira.tools.deploy.plans import for_laptop, for_robot
from lira.tools.deploy.target import Facts, Target
from lira.tools.joystick.device.rules import rules_text
from lira.tools.launch.processes import ProcessError
from lira.tools.lifecycle.services import unit_name
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.table import PROCESSES, SETS, rows
from lira.tools.verbs import VERBS

ROOT = Path(__file__).parents[3]
TWIN = Setup(processes=SETS["teach"], world="line", twin=("--world", "line"), folder="/home/ada/runs/plus-line")
ROBOT = Setup(processes=("robot",), endpoint="0.0.0.0:7447", robot=("--base", "/dev/core2", "--without", "camera"))
FACTS = Facts("/home/ada", 255, (3, 11))
OURS = File(".local/share/lira/rosbot/wheels/lira_rosbot-0.1.0-py3-none-any.whl", b"wheel")


def laptop(setup=TWIN, facts=FACTS, keys=None):
    return for_laptop(setup, facts, sys.executable, Path("/tmp"), keys)


def text_of(plan, name):
    return next(file.data.decode() for file in plan.files if file.path.endswith(name))


# Units


def test_there_is_a_unit_of_each_process_and_a_target_that_wants_them_all():
    plan = laptop()
    names = {unit_name("rosbot", name) for name in SETS["teach"]}
    assert {Path(file.path).name for file in plan.files if file.path.endswith(".service")} == names
    wants = next(line for line in text_of(plan, ".target").splitlines() if line.startswith("Wants="))
    assert set(wants.removeprefix("Wants=").split()) == names


def test_a_unit_runs_the_very_command_of_the_list():
    by_name = {process.name: process for process in PROCESSES}
    plan = laptop()
    for name in SETS["teach"]:
        line = f"ExecStart={' '.join(by_name[name].command(TWIN))}\n"
        assert line in text_of(plan, f"-{name}.service")


def test_a_unit_is_watched_restarted_after_growing_pauses_and_begins_paused():
    unit = text_of(laptop(), "-learner.service")
    for line in ("Type=notify", "WatchdogSec=30", "Restart=always", "RestartSec=1", "RestartMaxDelaySec=30"):
        assert f"\n{line}\n" in unit
    assert "--paused" in unit
    assert "After=lira-rosbot-twin.service" in unit
    old = text_of(laptop(facts=Facts("/home/ada", 249, (3, 10))), "-learner.service")
    assert "RestartSteps" not in old
    assert "\nRestartSec=4\n" in old


@pytest.mark.parametrize(
    ("word", "quoted"),
    [
        ("plain", "plain"),
        ("two words", '"two words"'),
        ("100%", '"100%%"'),
        ("$HOME", '"$$HOME"'),
        ('a"b\\c', '"a\\"b\\\\c"'),
        ("", '""'),
        (";", '";"'),
    ],
)
def test_what_systemd_would_expand_is_quoted(word, quoted):
    assert units.quoted(["x", word]) == f"x {quoted}"


@pytest.fixture
def verify(tmp_path):
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("no systemd-analyze is installed (Debian's systemd)")

    def look(plan):
        for file in plan.files:
            if file.path.endswith((".service", ".target")):
                (tmp_path / Path(file.path).name).write_bytes(file.data)
        names = [str(path) for path in sorted(tmp_path.glob("lira-*"))]
        environ = {"XDG_RUNTIME_DIR": str(tmp_path), "HOME": str(tmp_path), "PATH": os.environ["PATH"]}
        done = subprocess.run(
            [program, "--user", "verify", *names], check=False, capture_output=True, text=True, timeout=60, env=environ
        )
        return done.returncode, done.stdout + done.stderr

    return look


OLD = Facts("/home/ada", 249, (3, 11))  # no newer key than any systemd here knows


@pytest.mark.parametrize("names", [*SETS.values(), tuple(process.name for process in PROCESSES)])
def test_systemd_takes_the_units_without_a_word(verify, names):
    setup = Setup(
        processes=names,
        world="line",
        twin=("--world", "my world 100%.toml"),
        robot=ROBOT.robot,
        policy="my policy.safetensors",
        folder="/tmp/a $b",
    )
    assert verify(laptop(setup, OLD)) == (0, "")


def test_the_check_by_systemd_can_fail(verify):
    plan = for_robot(ROBOT, OLD, [OURS], None)  # its environment is not there
    status, words = verify(plan)
    assert status != 0
    assert "/home/ada/.local/share/lira/rosbot/venv/bin/python" in words


# Plans


def test_keys_go_along_for_their_user_alone_and_are_not_shown(tmp_path):
    init(tmp_path / "keys")
    plan = for_robot(ROBOT, FACTS, [OURS], tmp_path / "keys" / "robot")
    secrets = [file for file in plan.files if "/keys/" in file.path]
    assert {Path(file.path).name for file in secrets} >= {"key.pem", "cert.pem", "ca.pem"}
    assert {file.mode for file in secrets} == {SECRET}
    assert text_of(plan, "/environment") == "LIRA_KEYS=/home/ada/.config/lira/rosbot/keys\n"
    assert "PRIVATE KEY" not in plan.shown([])
    assert "key.pem (600," in plan.shown([])
    with tarfile.open(fileobj=io.BytesIO(plan.archive())) as archive:
        assert {member.mode for member in archive if "/keys/" in member.name} == {SECRET}


def test_what_are_no_keys_is_refused(tmp_path):
    with pytest.raises(ConfigError):
        laptop(keys=tmp_path)


def test_files_that_the_robots_words_name_go_along(tmp_path):
    settings = tmp_path / "my-robot.toml"
    settings.write_text("[base]\n")
    setup = Setup(processes=("robot",), robot=("--base", "/dev/core2", "--settings", str(settings)))
    plan = for_robot(setup, FACTS, [OURS], None)
    assert text_of(plan, "/my-robot.toml") == "[base]\n"
    assert "--settings /home/ada/.config/lira/rosbot/my-robot.toml" in text_of(plan, "-robot.service")
    settings.unlink()
    with pytest.raises(ConfigError, match=r"my-robot\.toml"):
        for_robot(setup, FACTS, [OURS], None)


@pytest.mark.parametrize(("python", "said"), [((3, 8), r"is 3\.8"), ((0, 0), "is none")])
def test_a_robot_whose_python_is_too_old_is_refused(python, said):
    with pytest.raises(ConfigError, match=said):
        for_robot(ROBOT, Facts("/home/ada", 255, python), [OURS], None)


def test_what_a_shell_prints_at_its_start_is_passed_over(home):
    (home / "shell").write_text('#!/bin/sh\necho welcome\necho 12\nexec /bin/sh "$@"\n')
    (home / "shell").chmod(0o755)
    (home.parent / "bin" / "sh").symlink_to(home / "shell")
    facts = Target().look("rosbot")
    assert (facts.home, facts.systemd, facts.python) == (str(home), 255, sys.version_info[:2])


def test_rules_go_along_and_who_may_install_them_is_told_how():
    assert text_of(laptop(), "60-lira-pad.rules") == rules_text()
    assert any(note.startswith("sudo install") and "60-lira-pad.rules" in note for note in laptop().notes)
    robot = for_robot(ROBOT, FACTS, [OURS], None)
    assert 'SYMLINK+="rplidar"' in text_of(robot, "99-lira-rosbot.rules")
    assert any("99-lira-rosbot.rules" in note for note in robot.notes)
    without = Setup(processes=("twin",), world="line")
    assert laptop(without).notes == ()


def test_the_robots_readme_has_the_rules_that_are_deployed():
    readme = (ROOT / "robot" / "README.md").read_text(encoding="utf-8")
    rules = (ROOT / "tools" / "deploy" / "99-lira-rosbot.rules").read_text(encoding="utf-8")
    for rule in rules.splitlines():
        assert rule.startswith("#") or rule in readme


def test_the_archive_holds_the_list_of_what_is_in_it():
    plan = for_robot(ROBOT, FACTS, [OURS], None)
    with tarfile.open(fileobj=io.BytesIO(plan.archive())) as archive:
        listed = archive.extractfile(plan.manifest).read().decode().splitlines()
        names = {member.name for member in archive}
    assert set(listed) == {*(file.path for file in plan.files), ".local/share/lira/rosbot/venv/"}
    assert names == {*(file.path for file in plan.files), plan.manifest}


def test_what_is_stale_goes_and_nothing_outside_the_home_folder_does():
    plan = Plan("rosbot", ("twin",), (File("a/new", b""),))
    assert plan.stale(["a/new", "a/old", "/etc/passwd", "../x", "a/../../y", ""]) == ["a/old"]


def test_wheels_are_installed_from_the_folder_that_goes_along():
    lines = packages.steps("rosbot", [OURS], "python3", offline=True)
    assert "--no-index" in lines[1]
    assert "'.local/share/lira/rosbot/wheels/lira_rosbot-0.1.0-py3-none-any.whl[robot,drive]'" in lines[1]
    assert "--no-index" not in packages.steps("rosbot", [OURS], "python3", offline=False)[1]


def test_a_folder_without_our_wheel_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"no lira_rosbot-\*\.whl"):
        packages.collect(tmp_path, "rosbot")


# The verb, on this machine, in a home of its own


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home folder, and a stand-in for systemd that notes what is asked of it."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("systemctl", "loginctl"):
        program = programs / name
        version = '[ "$1" = --version ] && echo "systemd 255 (255.4)" && exit'
        program.write_text(f'#!/bin/sh\n{version}\necho {name} "$@" >> {tmp_path}/asked\n')
        program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


def asked(home):
    path = home.parent / "asked"
    lines = path.read_text().splitlines() if path.exists() else []
    path.unlink(missing_ok=True)
    return lines


def files_of(home):
    return {str(path.relative_to(home)) for path in home.rglob("*") if path.is_file()}


def test_a_dry_run_shows_all_of_it_and_changes_nothing(home, capsys):
    assert main(["deploy", "laptop", "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "ExecStart=" in out
    assert "systemctl --user enable" in out
    assert "RestartSteps=5" in out
    assert "sudo install -m 644 ~/.config/lira/rosbot/60-lira-pad.rules" in out
    assert files_of(home) == set()
    assert asked(home) == []


@pytest.mark.parametrize(
    "words",
    [
        ["laptop"],
        ["laptop", "--robot", "192.0.2.1"],
        ["robot", "--host", "ada@nowhere.invalid", "--", "--base", "b", "--without", "lidar", "--without", "camera"],
        ["robot", "--", "--base", "b", "--without", "lidar", "--without", "camera"],
    ],
)
def test_a_dry_run_starts_no_program_and_so_needs_none(home, words, monkeypatch, capsys):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a dry run started a program"))
    monkeypatch.setenv("PATH", str(home.parent / "nothing"))
    at = words.index("--") if "--" in words else len(words)
    assert main(["deploy", *words[:at], "--dry-run", *words[at:]]) == 0
    out = capsys.readouterr().out
    assert "ExecStart=" in out
    assert "systemctl --user enable" in out
    assert files_of(home) == set()


def test_a_dry_run_supposes_the_home_of_who_is_named_and_says_so(home, capsys):
    words = ["--", "--base", "b", "--without", "lidar", "--without", "camera"]
    assert main(["deploy", "robot", "--host", "ada@rover", "--dry-run", *words]) == 0
    out = capsys.readouterr().out
    assert "on ada@rover" in out
    assert "supposed: /home/ada, systemd" in out
    assert "ExecStart=/home/ada/.local/share/lira/rosbot/venv/bin/python" in out
    assert re.search(r"lira_rosbot-\S+\.whl \(644, built from this checkout when it is deployed\)", out)


def test_a_dry_run_still_refuses_a_method_that_there_is_not(home):
    assert main(["deploy", "laptop", "--dry-run", "--method", "nope"]) == 2


def test_words_for_the_robot_that_are_missing_are_asked_for_after_the_dashes(home, capsys):
    assert main(["deploy", "robot", "--dry-run"]) == 2
    assert "after --" in capsys.readouterr().err


def test_it_is_deployed_changed_and_removed(home, capsys):
    assert main(["deploy", "laptop", "--set", "look"]) == 0
    assert "lira-rosbot.target is started" in capsys.readouterr().out
    units_ = home / ".config" / "systemd" / "user"
    assert (units_ / "lira-rosbot-pad.service").exists()
    assert (home / ".config" / "lira" / "rosbot").stat().st_mode & 0o077 == 0
    lines = asked(home)
    assert lines[-4].endswith("daemon-reload")
    assert lines[-3].startswith("systemctl --user enable --quiet lira-rosbot.target lira-rosbot-twin.service")
    assert lines[-2] == "systemctl --user restart lira-rosbot.target"

    assert main(["deploy", "laptop", "--set", "look", "--without", "pad"]) == 0
    assert not (units_ / "lira-rosbot-pad.service").exists()
    assert (units_ / "lira-rosbot-page.service").exists()
    assert any("disable --now lira-rosbot-pad.service" in line for line in asked(home))

    (home / "mine").write_text("stays")
    assert main(["deploy", "laptop", "--remove"]) == 0
    assert files_of(home) == {"mine"}
    assert "systemctl --user disable --now lira-rosbot.target" in asked(home)
    capsys.readouterr()
    assert main(["deploy", "laptop", "--remove"]) == 0
    assert "nothing was deployed" in capsys.readouterr().out


def test_a_list_that_was_tampered_with_removes_nothing_outside_the_home_folder(home):
    (home.parent / "precious").write_text("stays")
    folder = home / ".config" / "lira" / "rosbot"
    folder.mkdir(parents=True)
    (folder / "deployed").write_text(f"../precious\n{home.parent}/precious\na/../../precious\n/\n../\n")
    Target().run(removal("rosbot"))
    assert (home.parent / "precious").exists()
    assert home.is_dir()


def test_without_systemd_the_units_are_written_and_that_is_said(home, capsys):
    (home.parent / "bin" / "systemctl").write_text("#!/bin/sh\nexit 1\n")
    assert main(["deploy", "laptop", "--set", "look"]) == 0
    assert "nothing is started" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["robot", "--dry-run"],
        ["robot", "--dry-run", "--", "--base", "/dev/core2"],
        ["robot", "--dry-run", "--name", "../x", "--", "--base", "b", "--without", "lidar", "--without", "camera"],
        ["robot", "--remove", "--name", "x;y"],
        ["laptop", "--dry-run", "--world", "nowhere"],
        ["robot", "--host=-oProxyCommand=x", "--remove"],
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_done(home, words):
    assert main(["deploy", *words]) == 2
    assert files_of(home) == set()


def test_a_shell_that_fails_is_an_error_with_its_words(home):
    with pytest.raises(ProcessError, match="this machine: no room"):
        Target().run("echo no room >&2; exit 3")


def test_the_rows_of_a_deployment_are_those_of_the_list():
    assert [row.name for row in rows(ROBOT)] == ["robot"]


# The container


def container(word):
    lines = (ROOT / "Containerfile").read_text(encoding="utf-8").splitlines()
    return [line.removeprefix(word).strip() for line in lines if line.startswith(f"{word} ")]


def test_the_container_runs_a_twin_that_its_verb_understands():
    (entry,), (words,) = container("ENTRYPOINT"), container("CMD")
    assert json.loads(entry) == ["lira"]
    verb, *arguments = json.loads(words)
    parser = argparse.ArgumentParser()
    importlib.import_module(VERBS[verb].module).add_arguments(parser)
    args = parser.parse_args(arguments)
    assert args.insecure
    assert not is_loopback(args.listen)  # the container's own loopback reaches nobody


def test_the_container_gets_what_it_copies_and_nothing_else():
    (copied,) = container("COPY")
    sources = {source.split("/")[0] for source in copied.split()[:-1]}
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert {line.removeprefix("!") for line in ignored if line.startswith("!")} == sources
    assert "*" in ignored


def test_the_container_installs_a_part_that_there_is():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (parts,) = re.findall(r"\.whl\)\[([a-z,]+)\]", (ROOT / "Containerfile").read_text(encoding="utf-8"))
    assert set(parts.split(",")) <= set(project["optional-dependencies"])
