"""Standard output that is full, closed, or read by nobody any more: one line, and an orderly end."""

import re
import subprocess
import time
from pathlib import Path

import pytest
from fresh import python

from lira.tools import cli
from lira.tools.launch.processes import free_port, lira_command
from lira.tools.output.when import when

END_S = 5.0
FULL = Path("/dev/full")


def lira(*words, **streams):
    command = lira_command(*map(str, words))
    return subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True, timeout=60, **streams)


def twin():
    port = free_port()
    return lira_command("twin", "--name", f"t{port}", "--listen", f"127.0.0.1:{port}")


def one_line_and_remedy(done):
    what, remedy = done.stderr.splitlines()
    return done.returncode == 2 and what.startswith("lira") and remedy.startswith("  ")


@pytest.fixture
def log(tmp_path):
    from lira.fusion.log.label_log import DemonstrationLog
    from lira.hal.profile import load_profile

    DemonstrationLog(tmp_path / "log", load_profile("thesis-sim")).close()
    return tmp_path / "log"


@pytest.mark.parametrize(
    "words", [["--help"], ["twin", "--help"], ["labels", "check", "{log}"], ["labels", "check", "{log}", "--json", "-"]]
)
def test_a_full_disk_behind_standard_output(log, words):
    with FULL.open("w") as full:
        done = lira(*[word.format(log=log) for word in words], stdout=full)
    assert one_line_and_remedy(done), done.stderr
    assert "No space left on device" in done.stderr


def test_a_full_disk_behind_json(log):
    done = lira("labels", "check", log, "--json", FULL)
    assert one_line_and_remedy(done), done.stderr


def test_a_twin_that_cannot_say_that_it_serves_ends():
    with FULL.open("w") as full:
        done = subprocess.run(twin(), check=False, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert one_line_and_remedy(done), done.stderr


def test_a_twin_whose_reader_has_gone_ends_without_a_word():
    with subprocess.Popen(twin(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert "serves" in process.stdout.readline()
        process.stdout.close()
        began_s = time.monotonic()
        assert process.wait(30.0) == cli.EXIT_BROKEN_PIPE
        assert time.monotonic() - began_s < END_S
        assert process.stderr.read() == ""


@pytest.mark.parametrize("closed", [[1], [0, 1, 2], [0], [2]])
def test_closed_descriptors(tmp_path, closed):
    """The log that is opened next must not become one of them."""
    code = f"import os, sys; [os.close(n) for n in {closed}]; os.execv(sys.executable, {lira_command('--version')!r})"
    done = python(code)
    if 1 in closed:
        assert done.returncode == 2
        assert done.stderr == "" if 2 in closed else one_line_and_remedy(done)
    else:
        assert done.returncode == 0
        assert done.stdout.startswith("lira ")


@pytest.mark.parametrize(
    "error", [MemoryError(), RuntimeError("can't start new thread"), ImportError("x: failed to map segment")]
)
def test_too_little_memory_is_one_line(monkeypatch, capsys, error):
    def dispatch(*_):
        raise error

    monkeypatch.setattr(cli, "dispatch", dispatch)
    assert cli.main(["twin"]) == 2
    assert capsys.readouterr().err.splitlines()[0] == "lira twin: there is not enough memory"


def test_another_error_of_the_system_is_a_bug_and_shows(monkeypatch):
    def dispatch(*_):
        Path("/nowhere").stat()

    monkeypatch.setattr(cli, "dispatch", dispatch)
    with pytest.raises(FileNotFoundError):
        cli.main(["twin"])


def test_a_time_of_a_robot_is_told_as_time_of_day_and_one_of_a_twin_in_lockstep_in_seconds():
    assert when(12.34) == "12.3 s"
    assert re.fullmatch(r"2026-11-2\d \d\d:\d\d:\d\d\.5", when(1_795_746_224.55))
