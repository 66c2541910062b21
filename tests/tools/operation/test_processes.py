import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lira.tools.launch import processes
from lira.tools.launch.processes import ChildProcess, ProcessError, free_port, lira_command

READY_THEN_SLEEP = "import time; print('ready to serve', flush=True); time.sleep(60)"
DEAF = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print('ready', flush=True)
time.sleep(60)
"""


def python(code, tmp_path, name="child"):
    return ChildProcess(name, [sys.executable, "-c", code], tmp_path / f"{name}.log")


def test_wait_ready_returns_the_line(tmp_path):
    with python(READY_THEN_SLEEP, tmp_path) as child:
        assert child.wait_ready("ready to", timeout_s=20.0) == "ready to serve"
        assert child.status() is None
    assert child.status() is not None


def test_a_child_that_dies_before_it_is_ready_is_quoted(tmp_path):
    with (
        python("import sys; print('no camera'); sys.exit(3)", tmp_path) as child,
        pytest.raises(ProcessError, match=r"(?s)child ended with status 3.*no camera") as error,
    ):
        child.wait_ready("ready", timeout_s=20.0)
    assert str(tmp_path / "child.log") in error.value.remedy


def test_a_child_that_is_never_ready_is_given_up(tmp_path):
    with (
        python("import time; time.sleep(60)", tmp_path) as child,
        pytest.raises(ProcessError, match="not ready after"),
    ):
        child.wait_ready("ready", timeout_s=0.2)


def test_a_death_by_signal_is_named(tmp_path):
    with python("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", tmp_path) as child:
        assert child.wait(20.0) == -signal.SIGKILL
        assert "SIGKILL" in str(child.failure())


def test_stop_asks_first(tmp_path):
    code = "import time\nprint('ready', flush=True)\ntry: time.sleep(60)\nexcept KeyboardInterrupt: print('bye')"
    with python(code, tmp_path) as child:
        child.wait_ready("ready", timeout_s=20.0)
    assert child.status() == 0
    assert "bye" in child.output()


def test_a_child_that_ignores_every_request_is_killed(tmp_path, monkeypatch):
    quick = tuple((number, min(patience_s, 0.2)) for number, patience_s in processes.STOP_SIGNALS[:2])
    monkeypatch.setattr(processes, "STOP_SIGNALS", (*quick, processes.STOP_SIGNALS[2]))
    child = python(DEAF, tmp_path)
    child.wait_ready("ready", timeout_s=20.0)
    began_s = time.monotonic()
    assert child.stop() == -signal.SIGKILL
    assert time.monotonic() - began_s < 5.0
    assert child.stop() == -signal.SIGKILL  # twice is fine


def test_a_child_does_not_outlive_a_parent_that_is_killed(tmp_path):
    code = f"""
import pathlib, sys, time
from lira.tools.launch.processes import ChildProcess
child = ChildProcess("child", [sys.executable, "-c", {READY_THEN_SLEEP!r}], pathlib.Path({str(tmp_path / "log")!r}))
child.wait_ready("ready", 20.0)
print(child.pid, flush=True)
time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        os.kill(pid, 0)
        parent.kill()
    deadline_s = time.monotonic() + 10.0
    while is_running(pid):
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def is_running(pid):
    """Whether a process is there, and no zombie that nobody has taken note of."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_free_port_can_be_bound():
    port = free_port()
    with socket.socket() as tcp, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        tcp.bind(("127.0.0.1", port))
        udp.bind(("127.0.0.1", port))


def test_the_lira_command_runs_from_a_folder_that_has_its_own_tools(tmp_path, monkeypatch):
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "__init__.py").write_text("raise SystemExit('the wrong tools')\n")
    monkeypatch.chdir(tmp_path)
    with ChildProcess("lira", lira_command("--version"), tmp_path / "log") as child:
        assert child.wait(20.0) == 0
    assert child.output().startswith("lira ")
