"""The list of processes, what `lira up` understands, and when one is started again."""

import argparse
import socket
import sys

import pytest

from lira.hal.errors import ConfigError, MissingExtraError
from lira.tools.cli import EXTRAS, Parser, main
from lira.tools.launch.processes import free_port
from lira.tools.lifecycle.arguments import Ports, add_setup, check_method, check_packages, setup_of
from lira.tools.lifecycle.ports import free_from
from lira.tools.lifecycle.restart import CALM_S, LONGEST_S, READY_S, Restarts, pause_s
from lira.tools.lifecycle.setup import Setup, endpoint_of, run_folder
from lira.tools.lifecycle.table import PROCESSES, SETS, Host, chosen, rows
from lira.tools.verbs import VERBS

SETUP = Setup(
    processes=tuple(process.name for process in PROCESSES),
    world="line",
    twin=("--world", "line"),
    robot=("--base", "/dev/ttyS1", "--without", "lidar", "--without", "camera"),
    policy="camera-expert",
    folder="runs/mine",
)


# The list


@pytest.mark.parametrize("process", PROCESSES, ids=lambda process: process.name)
def test_every_row_is_a_command_that_its_verb_understands(process):
    _, dash, module, *words = process.command(SETUP, "python3")
    assert dash == "-m"
    if module != "lira.tools":
        assert module.startswith("lira.tools.lifecycle.")
        return
    verb, *arguments = words
    parser = Parser(allow_abbrev=False)
    __import__(VERBS[verb].module, fromlist=["add_arguments"]).add_arguments(parser)
    parser.parse_args(arguments)


@pytest.mark.parametrize("process", PROCESSES, ids=lambda process: process.name)
def test_whatever_could_drive_by_itself_begins_paused(process):
    words = process.command(SETUP)
    assert ("--paused" in words) == (process.name in ("learner", "driver"))


def test_the_packages_of_a_row_have_an_extra_that_brings_them():
    assert {package for process in PROCESSES for package in process.packages} <= set(EXTRAS)


def test_sets_name_rows_of_the_laptop_and_the_robot_comes_first():
    by_name = {process.name: process for process in PROCESSES}
    for names in SETS.values():
        assert all(by_name[name].host is Host.LAPTOP for name in names)
        assert by_name[names[0]].is_robot
        assert "monitor" in names


def test_a_real_robot_has_no_twin_and_what_is_left_out_is_left_out():
    assert chosen("look", twin=False, without=["pad"]) == ("monitor", "page")
    with pytest.raises(ConfigError, match="no process 'learner'"):
        chosen("look", twin=True, without=["learner"])
    assert [row.name for row in rows(Setup(processes=("page", "twin")))] == ["twin", "page"]


@pytest.mark.parametrize(
    ("host", "endpoint"),
    [
        ("rosbot", "rosbot:7447"),
        ("192.168.1.20:7000", "192.168.1.20:7000"),
        ("fe80::1", "[fe80::1]:7447"),
        ("[fe80::1]", "[fe80::1]:7447"),
        ("[fe80::1]:7000", "[fe80::1]:7000"),
    ],
)
def test_a_robots_port_is_the_usual_one_unless_it_is_said(host, endpoint):
    assert endpoint_of(host) == endpoint


def test_what_is_learned_is_kept_by_method_and_place():
    assert str(run_folder("rosbot", "plus", "line")) == "runs/plus-line"
    assert str(run_folder("rosbot", "my.methods:Mine", "")) == "runs/my.methods-Mine-rosbot"
    assert str(run_folder("rosbot", "plus", "worlds/mine.toml")) == "runs/plus-mine"


# What `lira up` understands


def asked(*words):
    parser = argparse.ArgumentParser()
    add_setup(parser)
    return setup_of(parser.parse_args(words), Ports())


def test_a_twin_is_the_usual_and_of_the_worlds_experiment():
    setup = asked("--world", "line-obstacles", "--layout", "3")
    assert setup.processes == SETS["teach"]
    assert setup.twin[:4] == ("--world", "line-obstacles", "--profile", "thesis-sim")
    assert setup.folder.endswith("runs/plus-line-obstacles")


def test_a_policy_makes_it_the_set_that_drives():
    assert asked("--policy", "camera-expert").processes == SETS["drive"]


def test_a_real_robot_is_reached_where_it_is():
    setup = asked("--robot", "rosbot.local")
    assert (setup.world, setup.twin, setup.endpoint) == ("", (), "rosbot.local:7447")
    assert "twin" not in setup.processes


@pytest.mark.parametrize(
    "words",
    [
        ["--set", "drive"],
        ["--set", "look", "--policy", "x"],
        ["--robot", "r", "--listen", "127.0.0.1:1"],
        ["--world", "nowhere"],
        ["--world", "line", "--profile", "nobody"],
    ],
)
def test_what_does_not_go_together_is_refused_before_anything_starts(words):
    with pytest.raises(ConfigError):
        asked(*words)


def test_a_novice_that_is_not_there_is_refused_before_anything_starts(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert main(["up", "--name", "absent", "--policy", str(tmp_path / "novice.safetensors")]) == 2
    assert "there is no checkpoint" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["nobody-knows-it", "switching"])
def test_a_method_by_which_nobody_learns_is_refused(method):
    with pytest.raises(ConfigError):
        check_method(asked("--method", method))


def test_a_package_that_a_process_lacks_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "segno", None)
    with pytest.raises(MissingExtraError, match="segno"):
        check_packages(asked("--set", "look"))


def test_a_second_robot_gets_the_next_port_that_nobody_has():
    port = free_port()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port))
        taken.listen()
        assert port < free_from(port) < port + 50


# When one is started again


def test_pauses_double_and_have_an_end():
    assert [pause_s(failures) for failures in range(7)] == [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, LONGEST_S]
    assert pause_s(10**6) == LONGEST_S


def test_who_dies_again_and_again_waits_longer_and_who_ran_well_does_not():
    life, now_s = Restarts(10.0), 0.0
    waits = []
    for ran_s in (1.0, 1.0, CALM_S, 1.0):
        assert life.is_due(now_s)
        life.started(now_s)
        life.ready(now_s)
        now_s += ran_s
        waits.append(life.ended(now_s))
        assert not life.is_due(now_s)
        now_s += waits[-1]
    assert waits == [1.0, 2.0, 1.0, 2.0]
    assert life.starts == 4


def test_who_is_silent_is_hung_and_who_is_heard_is_not():
    life = Restarts(10.0)
    life.started(0.0)
    life.ready(5.0)
    assert not life.is_hung(15.0)
    life.alive(15.0)
    assert not life.is_hung(25.0)
    assert life.is_hung(25.1)


def test_who_never_gets_ready_is_hung_too():
    life = Restarts(10.0)
    life.started(0.0)
    assert not life.is_hung(READY_S)
    assert life.is_hung(READY_S + 0.1)
    life.stopped(READY_S)
    assert not life.is_hung(READY_S + 1e6)
    assert not life.is_due(1e6)
