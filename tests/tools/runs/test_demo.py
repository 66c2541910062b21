"""The demo's supervision, with stand-ins for the twin and the learner. The real ones have their end-to-end test."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest
from synthetic_run import write_run

from lira.hal.errors import ConfigError
from lira.tools.cli import main
from lira.tools.launch.launch import Part
from lira.tools.launch.processes import ProcessError
from lira.tools.verbs.teach import demo

HERE = Path(__file__).parent
TWIN = "import time; print(\"twin 'x' serves world 'line'\", flush=True); time.sleep(60)"


def python(code):
    return [sys.executable, "-c", code]


def parts(*codes):
    """Stand-ins for the processes of a robot."""
    names = ("the twin", "the robot")
    return [
        Part(name, f"{name.split()[1]}.log", "serves world", lambda _, code=code: python(code))
        for name, code in zip(names, codes, strict=False)
    ]


def learner(folder, *, converged=True, unseen=1):
    """Return the command of a process that writes a whole run."""
    code = f"""
import sys, pathlib
sys.path.insert(0, {str(HERE)!r})
from synthetic_run import write_run
write_run(pathlib.Path({str(folder)!r}), unseen={unseen}, converged={converged})
"""
    return python(code)


@pytest.fixture(autouse=True)
def _keep_signals():
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


def test_a_run_that_is_proven_and_passes_what_it_is_shown_exits_0_with_its_report(tmp_path, capsys):
    assert demo.supervise(parts(TWIN), learner(tmp_path), tmp_path) == 0
    out = capsys.readouterr().out
    assert out.startswith("twin 'x' serves world")
    assert "alone it passed 1 of 1 unseen layout; 95 %: 3 to 100 %; collisions: 0, lost lines: 0" in out
    assert "proven after 2 training laps" in out
    assert out.splitlines()[-1] == f"report: {tmp_path / 'report.html'}"
    assert (tmp_path / "report.html").exists()


def test_a_run_that_does_not_converge_exits_1_and_still_reports(tmp_path, capsys):
    assert demo.supervise(parts(TWIN), learner(tmp_path, converged=False), tmp_path) == 1
    assert "not proven within 2 training laps: the novice alone did not pass" in capsys.readouterr().out
    assert (tmp_path / "report.html").exists()


def test_a_novice_that_is_proven_and_then_crashes_is_not_praised_for_it(tmp_path, capsys):
    assert demo.supervise(parts(TWIN), learner(tmp_path, unseen=3), tmp_path) == 1
    out = capsys.readouterr().out
    assert "alone it passed 2 of 3 unseen layouts; 95 %: 9 to 99 %; collisions: 1, lost lines: 0" in out
    assert "drives alone" not in out


def test_a_twin_that_dies_is_named_and_quoted(tmp_path):
    twin = parts("import time; print('serves world', flush=True); time.sleep(0.3); raise SystemExit('no floor')")
    with pytest.raises(ProcessError, match=r"(?s)the twin ended with status 1.*no floor") as error:
        demo.supervise(twin, python("import time; time.sleep(60)"), tmp_path)
    assert str(tmp_path / "twin.log") in error.value.remedy


def test_a_robot_in_front_of_the_twin_is_told_what_the_twin_said_and_named_when_it_dies(tmp_path):
    twin, robot = parts(TWIN, "import time; print('serves world', flush=True); time.sleep(0.3); raise SystemExit(4)")
    heard = []
    robot = replace(robot, command=lambda line, command=robot.command: heard.append(line) or command(line))
    with pytest.raises(ProcessError, match="the robot ended with status 4"):
        demo.supervise([twin, robot], python("import time; time.sleep(60)"), tmp_path)
    assert heard == ["twin 'x' serves world 'line'"]


def test_a_learner_that_dies_is_named_and_quoted(tmp_path):
    with pytest.raises(ProcessError, match=r"(?s)the learner ended with status 3.*boom"):
        demo.supervise(parts(TWIN), python("print('boom'); raise SystemExit(3)"), tmp_path)


def test_a_standstill_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "STALL_S", 0.5)
    with pytest.raises(ProcessError, match="nothing has happened"):
        demo.supervise(parts(TWIN), python("import time; time.sleep(60)"), tmp_path)


def test_an_earlier_run_is_not_touched(tmp_path):
    before = write_run(tmp_path, unseen=0).read_bytes()
    with pytest.raises(ConfigError, match="already holds a run"):
        demo.supervise(parts(TWIN), learner(tmp_path), tmp_path)
    assert (tmp_path / "run.jsonl").read_bytes() == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ending_the_demo_ends_its_processes(tmp_path, number):
    pids = tmp_path / "pids"
    child = f"import os, time; open({str(pids)!r}, 'a').write(f'{{os.getpid()}}\\n'); "
    child += "print('serves world', flush=True); time.sleep(60)"
    code = f"""
import pathlib, sys
from lira.tools.launch.launch import Part
from lira.tools.launch.lifetime import interruptible
from lira.tools.verbs.teach.demo import supervise
command = [sys.executable, "-c", {child!r}]
parts = [Part("the twin", "twin.log", "serves", lambda _: command)]
try:
    with interruptible():
        supervise(parts, command, pathlib.Path({str(tmp_path)!r}))
except KeyboardInterrupt:
    sys.exit(130)
"""
    with subprocess.Popen(python(code)) as parent:
        while len(pids.read_text().split() if pids.exists() else []) < 2:
            assert parent.poll() is None
            time.sleep(0.02)
        time.sleep(0.5)  # both run; now the parent has had the time to know it, too
        parent.send_signal(number)
        assert parent.wait(30) == 130
    for pid in map(int, pids.read_text().split()):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_missing_experts_are_named_before_anything_starts(tmp_path):
    profile = tmp_path / "mine.toml"
    like = resources.files("lira.hal") / "profiles" / "thesis-sim.toml"
    profile.write_text(like.read_text(encoding="utf-8").replace('"thesis-sim"', '"mine"'))
    words = ["demo", "--profile", str(profile), "--run", str(tmp_path / "run")]
    code = "import sys; sys.modules.update(dict.fromkeys(['torch', 'pybullet', 'zenoh', 'safetensors']))\n"
    code += f"from lira.tools.cli import main; sys.exit(main({words!r}))"
    done = subprocess.run(python(code), check=False, capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "lira demo: no camera expert comes with the profile 'mine'"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("words", "proof"),
    [([], "fresh:3"), (["--world", "corridor"], "fresh:6"), (["--world", "corridor", "--proof", "own"], "own")],
)
def test_a_world_is_proven_as_its_task_says_unless_somebody_asks_for_something_else(words, proof, monkeypatch):
    started = []
    monkeypatch.setattr(demo, "supervise", lambda *words: started.extend(words) or 0)
    assert main(["demo", *words, "--randomise"]) == 0
    parts, fusion, _ = started
    assert fusion[fusion.index("--proof") + 1] == proof
    assert "--randomise" in parts[0].command("")
