"""Where trials are played: a Dask cluster of real processes on this machine, and what is played again."""

import os
import shutil
import socket
import subprocess
import sys
import termios
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import pytest
from made_up_outcomes import HOLD
from short_trials import short_trial, timeless, write_world

from lira.hal.errors import ConfigError
from lira.tools.cli import main
from lira.tools.experiments.playing import fingerprint as fingerprints
from lira.tools.experiments.playing.fingerprint import code, fingerprint, imported, sources
from lira.tools.experiments.playing.kept import keep, kept
from lira.tools.experiments.playing.pools import Cluster, Here
from lira.tools.experiments.playing.runner import run_trials
from lira.tools.experiments.trial import play
from lira.tools.launch.processes import free_port

START_S = 60.0


def nothing(trials):
    """A pool that must not be needed."""
    assert not trials
    yield from ()


@contextmanager
def cluster(*, workers, threads=1):
    """A scheduler and its workers as separate processes; yields the address."""
    from distributed import Client

    address = f"tcp://127.0.0.1:{free_port()}"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    plain = ["--no-dashboard", "--host", "127.0.0.1"]
    where = Path(__file__).parents[3]
    processes = [subprocess.Popen([*dask, "scheduler", *plain, "--port", address.rsplit(":")[-1]], cwd=where, **quiet)]
    try:
        wait_for(lambda: answers(address))
        if workers:
            sizes = ["--nworkers", str(workers), "--nthreads", str(threads), "--no-nanny"]
            processes.append(subprocess.Popen([*dask, "worker", address, *plain, *sizes], cwd=where, **quiet))
            with Client(address, timeout=START_S) as client:
                client.wait_for_workers(workers, timeout=START_S)
        yield address
    finally:
        for process in reversed(processes):  # a worker takes leave of its scheduler
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=10)
            process.kill()
            process.wait()


def answers(address):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", int(address.rsplit(":")[-1]))) == 0


def wait_for(condition):
    deadline = time.monotonic() + START_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.fixture
def world(tmp_path):
    return write_world(tmp_path)


@pytest.mark.filterwarnings("default")  # what distributed warns of is its own affair
def test_a_cluster_plays_what_this_machine_plays(world, tmp_path):
    trials = [short_trial(world, name="hg-dagger", lira=None)]
    with cluster(workers=1) as address:
        there = run_trials(trials, tmp_path / "there", Cluster(address))
    here = run_trials(trials, tmp_path / "here", Here(1))
    assert [timeless(each) for each in there] == [timeless(each) for each in here]
    assert run_trials(trials, tmp_path / "there", nothing) == there


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(("workers", "threads", "wrong"), [(0, 1, "no worker"), (1, 2, "more than one thread")])
def test_a_cluster_that_would_play_otherwise_is_refused(world, tmp_path, workers, threads, wrong):
    with cluster(workers=workers, threads=threads) as address, pytest.raises(ConfigError, match=wrong) as refused:
        run_trials([short_trial(world)], tmp_path, Cluster(address))
    assert "dask worker" in refused.value.remedy


@pytest.mark.filterwarnings("default")
def test_a_cluster_that_is_not_there_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("lira.tools.experiments.playing.pools.PATIENCE_S", 0.5)
    address = f"tcp://127.0.0.1:{free_port()}"
    assert main(["experiment", "tableC1", "--seeds", "1", "--run", str(tmp_path), "--scheduler", address]) == 2
    assert "no Dask scheduler answers" in capsys.readouterr().err


def test_an_outcome_of_other_code_is_played_again_and_says_so(world, tmp_path, capsys):
    trial = short_trial(world)
    (first,) = run_trials([trial], tmp_path, Here(1))
    assert first.fingerprint
    keep(msgspec.structs.replace(first, fingerprint="0" * 16, labels={}), tmp_path)
    (second,) = run_trials([trial], tmp_path, Here(1))
    assert "1 kept trial of other code" in capsys.readouterr().err
    assert timeless(second) == timeless(first)
    assert kept(trial, tmp_path) == second


def test_a_run_that_is_stopped_half_way_goes_on_where_it_was(world, tmp_path):
    trials = [short_trial(world), short_trial(world, name="hg-dagger", lira=None)]

    def stopped(missing):
        yield play(missing[0])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_trials(trials, tmp_path, stopped)
    asked = []

    def going_on(missing):
        asked.extend(missing)
        yield from map(play, missing)

    outcomes = run_trials(trials, tmp_path, going_on)
    assert asked == trials[1:]
    assert [each.trial for each in outcomes] == trials


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_a_bar_on_a_terminal_and_lines_elsewhere(terminal):
    script = (
        "import sys; sys.path.insert(0, 'tests/tools/experiments')\n"
        "from made_up_outcomes import HOLD, outcome\n"
        "from lira.tools.experiments.playing.runner import Bar\n"
        "with Bar(3, 1) as bar:\n"
        "    bar.note(outcome(HOLD, 7))\n"
    )
    ours, theirs = os.openpty() if terminal else os.pipe()
    if terminal:
        termios.tcsetwinsize(theirs, (24, 120))
    where = Path(__file__).parents[3]
    try:
        subprocess.run([sys.executable, "-c", script], stderr=theirs, cwd=where, check=True, timeout=60)
        os.set_blocking(ours, False)
        pieces = []
        with suppress(BlockingIOError):
            while True:
                pieces.append(os.read(ours, 10_000))
        shown = b"".join(pieces).decode()
    finally:
        os.close(ours)
        os.close(theirs)
    assert f"[2/3] race {HOLD} scripted seed 7: converged after 2 laps, 40 human labels" in shown
    assert ("| 2/3 [" in shown) is terminal


def test_the_fingerprint_follows_the_world_and_the_experts(world, monkeypatch, tmp_path):
    before = fingerprint(world, "line")
    fingerprint.cache_clear()
    assert fingerprint(world, "line") == before
    text = Path(world).read_text()
    Path(world).write_text(text.replace("x_m = 3.4", "x_m = 3.5"))
    fingerprint.cache_clear()
    assert fingerprint(world, "line") != before
    Path(world).write_text("# a comment\n" + text)
    expert = tmp_path / "expert"
    shutil.copy(fingerprints.expert_path("lidar", fingerprints.load_profile("thesis-sim")), expert)
    fingerprint.cache_clear()
    assert fingerprint(world, "line") == before
    expert.write_bytes(expert.read_bytes() + b"0")
    monkeypatch.setattr(fingerprints, "expert_path", lambda *_: expert)
    fingerprint.cache_clear()
    assert fingerprint(world, "line") != before
    fingerprint.cache_clear()


def test_the_fingerprint_covers_what_a_trial_runs_and_nothing_beside_it():
    names = {str(path.relative_to(fingerprints.ROOT)) for path in sources(fingerprints.START)}
    assert {
        "fusion/methods/lira.py",
        "fusion/methods/rivals/hg_dagger.py",
        "fusion/teaching/teacher.py",
        "sim_backend/twin.py",
    } <= names
    assert {"hal/safety/governor.py", "tools/runs/build.py", "tools/experiments/trial.py"} <= names
    assert not {"fusion/service.py", "tools/experiments/playing/runner.py", "tools/cli.py"} & names


def test_comments_and_docstrings_do_not_count_as_code(tmp_path):
    path = tmp_path / "module.py"
    path.write_text('"""One."""\ndef f(x):\n    """Two."""\n    return x + 1  # why\n')
    before = code(path)
    path.write_text('"""Other."""\n\ndef f(x):\n    return x + 1\n')
    assert code(path) == before
    path.write_text("def f(x):\n    return x + 2\n")
    assert code(path) != before
    path.write_text("import lira.hal.port\nfrom lira.fusion.methods import lira\n")
    assert imported(path) == ["lira.hal.port", "lira.fusion.methods", "lira.fusion.methods.lira"]


def test_where_a_module_lies_does_not_count_as_code(tmp_path):
    path = tmp_path / "module.py"
    text = "from lira.hal import port\n\n\ndef f():\n    from lira.fusion import control\n    return port, control\n"
    path.write_text(text)
    before = code(path)
    path.write_text(text.replace("lira.hal", "lira.hal.other").replace("lira.fusion", "lira.loop"))
    assert code(path) == before
    path.write_text("from lira.hal import port\n")
    assert code(path) == b""
