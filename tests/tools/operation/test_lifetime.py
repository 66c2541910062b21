"""How a process ends: in time, with everything saved, by what ended it."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from lira.hal.errors import StorageError
from lira.tools.launch.lifetime import CLOSE_S, PATIENCE_S, Interrupted, heard, interruptible, saving

# It hears of a signal, and heeds it or not.
CLIENT = """
import signal, sys, time
from lira.tools.launch.lifetime import interruptible, stop_or_interrupt, saving
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever the shell that runs the tests has ignored
with interruptible():
    try:
        with saving(lambda: lambda: "saved", print), stop_or_interrupt() as stop:
            print("up", flush=True)
            {body}
    except KeyboardInterrupt as interrupt:
        print(f"interrupted by {{interrupt.number}}")
"""


def run(body, number):
    code = CLIENT.format(body=body)
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "up\n"
        began_s = time.monotonic()
        process.send_signal(number)
        said = process.stdout.read()
        assert process.wait(10.0) == 0
    return said, time.monotonic() - began_s


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_heeds_the_signal_ends_by_itself(number):
    said, took_s = run("stop.wait(60.0)", number)
    assert said == "saved\n"
    assert took_s < PATIENCE_S


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_does_not_is_interrupted_and_saved_too(number):
    said, took_s = run("time.sleep(60.0)", number)
    assert said == f"saved\ninterrupted by {int(number)}\n"
    assert took_s < 3.0


def test_what_a_client_may_take_to_end_is_within_what_is_promised():
    assert PATIENCE_S + 2 * CLOSE_S <= 2.5  # of 3 s; it saves in the rest


def test_what_ended_it_is_told_and_not_that_it_could_not_be_saved():
    def snapshot():
        raise StorageError("full")

    with pytest.raises(ValueError, match="first"), saving(snapshot, print):
        raise ValueError("first")
    with pytest.raises(StorageError), saving(snapshot, print):
        pass


def test_what_a_shell_said_to_ignore_is_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interruptible():
            signal.raise_signal(signal.SIGHUP)
            with pytest.raises(Interrupted):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_thread_that_writes_in_vain_ends_the_process_with_what_it_met():
    def write():
        raise BrokenPipeError(32, "Broken pipe")

    def serve():
        with interruptible(), heard():
            threading.Thread(target=write).start()
            time.sleep(10.0)

    with pytest.raises(BrokenPipeError):
        serve()


def test_a_process_with_a_dead_link_leaves_without_waiting_for_it_and_tidies_up(tmp_path):
    code = "import sys, tempfile, threading, time; from lira.tools.launch.lifetime import process\n"
    code += f"folder = tempfile.TemporaryDirectory(dir={str(tmp_path)!r}); print('x')\n"
    code += "threading.Thread(target=time.sleep, args=[60]).start(); process(lambda: 3)"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=10)
    assert (done.returncode, done.stdout) == (3, "x\n")
    assert list(tmp_path.iterdir()) == []
