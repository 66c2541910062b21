"""Strangers without keys who hold connections open: whoever has keys gets in, and who is in hears of it."""

import signal
import socket
import sys
import time
from contextlib import ExitStack

import pytest
from keyed_bed import NAME, make_keys, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.security.keys import load_keys
from lira.hal.bus.topics import DIAGNOSTICS, INFO
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

STRANGERS = 300
HALF_A_RECORD = b"\x16\x03\x01\x02\x00"  # of a TLS handshake


@pytest.fixture
def folder(tmp_path):
    return make_keys(tmp_path / "keys")


def limited(option, files, command):
    return [sys.executable, "-c", LIMIT, option, str(files), *command]


LIMIT = """
import os, resource, sys
option, files, *command = sys.argv[1:]
hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (int(files), hard if option == "soft" else int(files)))
os.execvp(command[0], command)
"""


def twin(folder, tmp_path, monkeypatch, option, files):
    endpoint = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("LIRA_KEYS", str(folder / "robot"))
    command = lira_command("twin", "--name", NAME, "--listen", endpoint, "--renderer", "tiny")
    return endpoint, ChildProcess("twin", limited(option, files, command), tmp_path / "twin.log")


def crowd(stack, endpoint):
    host, port = endpoint.split(":")
    for _ in range(STRANGERS):
        stack.enter_context(socket.create_connection((host, int(port)), 5.0)).sendall(HALF_A_RECORD)


def test_a_laptop_gets_past_half_open_connections(folder, tmp_path, monkeypatch):
    endpoint, process = twin(folder, tmp_path, monkeypatch, "soft", 256)
    with process as served, ExitStack() as stack:
        served.wait_ready("serves", 40.0)
        crowd(stack, endpoint)
        laptop = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
        stack.callback(laptop.close)
        assert laptop.ask(INFO, timeout_s=10.0)


def test_a_robot_out_of_files_says_so_and_ends_in_good_order(folder, tmp_path, monkeypatch):
    endpoint, process = twin(folder, tmp_path, monkeypatch, "hard", 128)
    with process as served, ExitStack() as stack:
        served.wait_ready("serves", 40.0)
        laptop = Bus(NAME, connect=endpoint, keys=load_keys(folder / "laptop"))
        stack.callback(laptop.close)
        diagnostics = laptop.reader(DIAGNOSTICS)
        wait_for(lambda: diagnostics.newest() is not None, 10.0)
        crowd(stack, endpoint)

        def told():
            link = next(s for s in diagnostics.newest().message.status if s.name.endswith("link"))
            return link.level == 1 and int(dict(link.values)["refused links for want of files"]) > 0

        wait_for(told, 10.0)
        began_s = time.monotonic()
        served.signal(signal.SIGINT)
        assert served.wait(10.0) == 0
        assert time.monotonic() - began_s < 5.0
        assert "Traceback" not in served.output()
        assert "no more files may be opened" in served.output()
