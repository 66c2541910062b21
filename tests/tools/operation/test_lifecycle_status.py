"""What is written down about a robot that is up, and what `lira status`, `lira logs` and `lira down` make of it."""

import json
import os
import subprocess
import sys
import time

import msgspec
import pytest
from fresh import python

from lira.hal.bus.sensors import SENSORS
from lira.hal.errors import ConfigError
from lira.hal.profile import load_profile
from lira.tools.cli import main
from lira.tools.lifecycle import folder as folders
from lira.tools.lifecycle import services
from lira.tools.lifecycle.folder import AlreadyUpError, StateFolder
from lira.tools.lifecycle.logs import Follower, last_lines
from lira.tools.lifecycle.records import HEARD, STATE, Heard, ProcessState, State, TopicState
from lira.tools.lifecycle.restart import CALM_S, Phase
from lira.tools.lifecycle.setup import Setup
from lira.tools.lifecycle.watch.line import WINDOW_S, Rate
from lira.tools.lifecycle.watch.monitor import rate_of
from lira.tools.lifecycle.watch.status import as_object, as_text, look
from lira.tools.verbs import VERBS, module_of

SETUP = Setup(processes=("twin", "learner"), world="line")


# What is written down


@pytest.fixture
def state_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = StateFolder("rosbot")
    folder.make()
    return folder


def test_a_name_has_one_supervisor_and_everybody_sees_who(state_folder, monkeypatch):
    monkeypatch.setattr(folders, "LOOK_S", 0.01)
    assert state_folder.supervisor() is None
    with state_folder.held():
        assert folders.names() == ["rosbot"]
        code = "import sys; from lira.tools.lifecycle.folder import StateFolder\n"
        code += "print(StateFolder('rosbot').supervisor())"
        seen = python(code)
        assert seen.stdout.strip() == str(os.getpid())
        with pytest.raises(AlreadyUpError, match="'rosbot' is up already"), state_folder.held():
            pass
    assert state_folder.supervisor() is None
    assert folders.names() == []


def test_the_folder_is_its_users_alone(state_folder):
    assert state_folder.path.stat().st_mode & 0o077 == 0


def test_a_name_that_is_none_is_refused(state_folder):
    with pytest.raises(ConfigError):
        StateFolder("../elsewhere")


NOW_S = 1000.0
ROWS = (
    ProcessState("twin", "the twin", Phase.RUNS, NOW_S - 90.0, 11, 1, "serves world 'line'"),
    ProcessState("learner", "learns", Phase.WAITS, NOW_S - 1.0, None, 3, "", "signal SIGKILL"),
)
HEARS = Heard(
    NOW_S - 0.2,
    (TopicState("scan", 9.7, 10.0, 0.1), TopicState("lira/decision", 0.0, 5.0, None)),
    "two links each",
    "disarmed",
    "paused",
    "idle",
    "PAUSED",
    "It stands.",
    "P goes on.",
)


MONITOR = ProcessState("monitor", "hears", Phase.RUNS, NOW_S - 90.0, 12, 1)


def write(folder, pid, processes=ROWS, heard=HEARS):
    folder.write(STATE, State(SETUP, pid, NOW_S - 300.0, processes))
    folder.write(HEARD, heard)


def test_status_tells_processes_topics_link_and_who_drives(state_folder):
    with state_folder.held():
        write(state_folder, state_folder.supervisor())
        status = look("rosbot", NOW_S)
        text, told = as_text(status), as_object(status)
    assert "'rosbot' is up for 5 min: twin in 'line' at 127.0.0.1:7447" in text
    assert "twin      runs   11  90 s       1  serves world 'line'" in text
    assert "learner  waits        1 s       3  learns (it ended with signal SIGKILL)" in text
    assert "scan   9.7     10    0.3" in text  # as old as it was then, and as the note of it is
    assert "lira/decision" not in text
    assert text.endswith("link: two links each\ngovernor: disarmed\nPAUSED: It stands. P goes on.")
    assert (told["up"], told["well"], told["for_s"]) == (True, False, 300.0)
    assert [row["phase"] for row in told["processes"]] == ["runs", "waits"]
    assert told["heard"]["age_s"] == 0.2
    assert told["heard"]["topics"][1]["age_s"] is None
    json.dumps(told, allow_nan=False)


def test_how_a_process_ended_is_told_until_it_has_run_for_a_minute(state_folder):
    def told(runs_s):
        learner = ProcessState("learner", "learns", Phase.RUNS, NOW_S - runs_s, 12, 2, "", "signal SIGKILL")
        with state_folder.held():
            write(state_folder, state_folder.supervisor(), (ROWS[0], learner))
            return as_text(look("rosbot", NOW_S))

    assert "learns (it ended with signal SIGKILL)" in told(CALM_S - 1.0)
    assert "SIGKILL" not in told(CALM_S)


def test_remedies_name_the_robot_that_was_asked_for(state_folder, capsys):
    assert main(["logs", "--name", "second"]) == 2
    assert "lira up --name second." in capsys.readouterr().err
    assert "lira up --name second" in as_text(look("second", NOW_S))
    assert as_text(look("rosbot", NOW_S)).endswith("lira up")
    second = StateFolder("second")
    with second.held():
        with pytest.raises(AlreadyUpError, match="'second' is up already") as refused, second.held():
            pass
        assert "lira down --name second" in refused.value.remedy
        assert folders.meant(None) == "second"
        assert folders.meant("third") == "third"
        old = msgspec.structs.replace(HEARS, time_s=0.0)
        write(second, second.supervisor(), (MONITOR,), old)
        assert "lira logs monitor --name second" in as_text(look("second", NOW_S))


def test_all_is_well_when_all_of_it_runs_and_the_robot_is_heard(state_folder):
    with state_folder.held():
        write(state_folder, state_folder.supervisor(), (ROWS[0], MONITOR))
        assert look("rosbot", NOW_S).is_well
        old = look("rosbot", NOW_S + 60.0)
        assert not old.is_well
        assert "nothing is heard of the robot" in as_text(old)
        write(state_folder, state_folder.supervisor(), ROWS[:1])  # where nobody listens
        assert look("rosbot", NOW_S + 60.0).is_well


def test_what_an_earlier_supervisor_wrote_is_not_told(state_folder):
    write(state_folder, 1)
    assert look("rosbot", NOW_S).state is None
    with state_folder.held():
        assert look("rosbot", NOW_S).state is None
    assert "nothing is up for 'rosbot'" in as_text(look("rosbot", NOW_S))


def test_a_record_of_another_version_is_an_error_that_says_which_file(state_folder):
    with state_folder.held():
        (state_folder.path / STATE).write_bytes(msgspec.json.encode({"setup": 1}))
        with pytest.raises(ConfigError, match=STATE):
            look("rosbot", NOW_S)


def test_status_needs_no_bus_and_nothing_heavy(tmp_path):
    code = "import sys; from lira.tools.cli import main; main(['status', '--json'])\n"
    code += "print([name for name in ('zenoh', 'numpy', 'cv2', 'torch') if name in sys.modules])"
    began_s = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=True, capture_output=True, text=True, timeout=30, env={"XDG_STATE_HOME": str(tmp_path), "HOME": "/none"},
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == "[]"
    assert time.monotonic() - began_s < 10.0


# Rates and logs


def test_a_rate_is_that_of_the_last_seconds():
    rate = Rate()
    for tenth in range(100):
        rate.note(tenth / 10)
    assert rate.hz(9.9) == pytest.approx(10.0, abs=0.5)
    assert rate.hz(9.9 + WINDOW_S) == 0.0


def test_a_sensors_usual_rate_is_the_profiles():
    rates = {sensor.name: rate_of(sensor, load_profile("thesis-sim")) for sensor in SENSORS}
    assert (rates["scan"], rates["camera"], rates["odom"]) == (10.0, 15.0, None)


def test_the_last_lines_of_a_log(tmp_path):
    log = tmp_path / "x.log"
    assert last_lines(log, 3) == []
    log.write_text("".join(f"line {number}\n" for number in range(50_000)))
    assert last_lines(log, 2) == ["line 49998", "line 49999"]
    assert last_lines(log, 0) == []


def test_following_gives_whole_lines_once_also_of_a_log_that_begins_anew(tmp_path):
    log = tmp_path / "twin.log"
    log.write_text("old\n")
    follower = Follower([log, tmp_path / "later.log"])
    assert follower.new_lines() == []
    with log.open("a") as file:
        file.write("new\nhalf")
    assert follower.new_lines() == [("twin", "new")]
    with log.open("a") as file:
        file.write(" done\n")
    (tmp_path / "later.log").write_text("first\n")
    assert follower.new_lines() == [("twin", "half done"), ("later", "first")]
    log.write_text("anew\n")
    assert follower.new_lines() == [("twin", "anew")]


def test_logs_of_nobody_are_an_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert main(["logs"]) == 2
    assert "nothing was ever up as 'rosbot'" in capsys.readouterr().err
    folder = StateFolder("rosbot")
    folder.make()
    folder.log("twin").write_text("one\ntwo\n")
    folder.log("learner").write_text("three\n")
    assert main(["logs", "-n", "1"]) == 0
    assert capsys.readouterr().out == "learner | three\ntwin    | two\n"
    assert main(["logs", "twin"]) == 0
    assert capsys.readouterr().out == "one\ntwo\n"
    assert main(["logs", "page"]) == 2


def test_to_take_down_what_is_not_up_is_no_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert main(["down"]) == 0
    assert capsys.readouterr().out == "nothing was up for 'rosbot'\n"
    assert main(["status"]) == 1
    assert "lira up" in capsys.readouterr().out


def test_the_verbs_stand_in_the_table():
    assert {VERBS[name].module for name in ("up", "status", "logs", "down")} == {
        module_of("operation", name) for name in ("up", "status", "logs", "down")
    }


# Services of systemd

SHOWN = """Id=lira-rosbot-twin.service
ActiveState=active
MainPID=11
NRestarts=0
StatusText=twin 'rosbot' serves
StateChangeTimestampMonotonic=910000000
Result=success

MainPID=0
Id=lira-rosbot-learner.service
ActiveState=activating
NRestarts=3
StatusText=
StateChangeTimestampMonotonic=999000000
Result=watchdog
"""


@pytest.fixture
def deployed(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / services.config_folder("rosbot")
    folder.mkdir(parents=True)
    setup = Setup(processes=("twin", "learner"), world="line")
    (folder / services.SETUP).write_bytes(msgspec.json.encode(setup))
    return setup


def test_services_are_told_as_any_process_is(deployed, monkeypatch):
    asked = []
    monkeypatch.setattr(services, "ask_systemd", lambda words: asked.append(words) or SHOWN)
    state = services.look("rosbot", services.ask_systemd)
    assert asked[0][2:] == ["lira-rosbot-twin.service", "lira-rosbot-learner.service"]
    twin, learner = state.processes
    assert (twin.phase, twin.pid, twin.starts, twin.says) == (Phase.RUNS, 11, 1, "twin 'rosbot' serves")
    assert (learner.phase, learner.pid, learner.starts, learner.ended) == (Phase.STARTS, None, 4, "watchdog")
    assert state.since_s == 910.0
    assert (state.setup, state.runs) == (deployed, False)


def test_status_and_down_know_services(deployed, tmp_path, monkeypatch, capsys):
    program = tmp_path / "systemctl"
    (tmp_path / "shown").write_text(SHOWN)
    program.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n[ "$2" = show ] && cat {tmp_path}/shown\nexit 0\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert main(["status"]) == 1
    assert "(services of systemd): twin in 'line'" in capsys.readouterr().out
    assert main(["down"]) == 0
    assert "stopped until the machine starts again" in capsys.readouterr().out
    assert (tmp_path / "asked").read_text().splitlines()[-1] == "--user stop lira-rosbot.target"


@pytest.mark.parametrize("text", ["", SHOWN.replace("activating", "inactive").replace("=active\n", "=inactive\n")])
def test_services_that_are_stopped_or_of_no_systemd_are_not_up(deployed, text):
    assert services.look("rosbot", lambda _: text) is None
