"""What `lira fusion` and `lira drive` say to bad input: one line and the remedy, exit status 2, and nothing lost."""

import json
import threading
import uuid
from functools import partial

import numpy as np
import pytest
from fresh import lira

from lira.fusion.experts.files import shipped_path
from lira.fusion.inference.architecture import Architecture
from lira.fusion.inference.build import driving
from lira.fusion.inference.checkpoint import Checkpoint, save_checkpoint
from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.log.run_log import RunRecord, RunWriter
from lira.fusion.preprocess import Features, shapes_of
from lira.hal.bus.bus import Bus
from lira.hal.client import connect
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.tools import cli
from lira.tools.launch.processes import free_port

PROFILE, OTHER = load_profile("thesis-sim"), load_profile("rosbot2")
WORLD = {"description": "a line", "name": "mine", "line": {"pieces": [{"straight_m": 9.0}]}}
WORLD["limits"] = {"lost_m": 1.0, "finish_m": 5.0}


@pytest.fixture(scope="module")
def address():
    """A robot in lockstep that says it is a twin, served from a thread; all tests here share it."""
    name, endpoint, stop = f"t{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}", threading.Event()
    bus, inner = Bus(name, listen=endpoint), NullRobot(PROFILE)
    server = HalServer(GovernedRobot(inner), bus, inner, arena_info=json.dumps(WORLD).encode(), lockstep=True)
    thread = threading.Thread(target=server.run, args=[stop])
    thread.start()
    yield ["--name", name, "--connect", endpoint]
    stop.set()
    thread.join(10.0)
    assert bus.close()


@pytest.fixture
def refused(capsys):
    """Run `lira` and return what it complains of and the remedy, one line each."""

    def run(*words):
        assert cli.main([str(word) for word in words]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        what, remedy = captured.err.splitlines()
        assert remedy.startswith("  ")
        return what, remedy

    return run


def write_log(path, profile=PROFILE, count=3):
    seen = Features(**{name: np.zeros(shape, np.float32) for name, shape in shapes_of(profile).items()})
    with DemonstrationLog(path, profile) as log:
        for seq in range(count):
            log.append(Demonstration(0.2 * seq, seq, 1, "human", (1.0, 0.5), (0.0, 0.0), True, seen))
    return path


def test_an_unknown_policy_names_the_known_ones(address, refused):
    what, remedy = refused("drive", *address, "sonar-expert")
    assert what == "lira drive: unknown policy 'sonar-expert'"
    assert "camera-expert, lidar-expert" in remedy


def test_a_broken_checkpoint_is_named(address, refused, tmp_path):
    path = tmp_path / "broken.safetensors"
    path.write_bytes(shipped_path("camera", PROFILE).read_bytes()[:-100])
    what, remedy = refused("drive", *address, path)
    assert f"{path} is not a whole .safetensors file" in what
    assert "Restore the file" in remedy


def test_a_missing_checkpoint_is_named(address, refused, tmp_path):
    what, _ = refused("drive", *address, tmp_path / "none.safetensors")
    assert "there is no checkpoint" in what


def test_the_checkpoint_of_another_profile_is_refused(address, refused, tmp_path):
    path = tmp_path / "real.safetensors"
    what = Architecture("lidar", {"scan": shapes_of(OTHER)["scan"]}, 0)
    network = driving(what, {name: np.zeros(shape, np.float32) for name, shape in what.weights.items()})
    save_checkpoint(path, network, Checkpoint.of(network, "rosbot2", "lira", 0))
    what, remedy = refused("drive", *address, path)
    assert "trained for 'rosbot2'" in what
    assert "the checkpoint of this profile" in remedy


@pytest.mark.parametrize("teacher", ["none", "perfect"])
def test_a_log_whose_header_is_damaged_is_named_and_left_as_it_is(address, refused, tmp_path, teacher):
    path = write_log(tmp_path / "labels.lira")
    data = bytearray(path.read_bytes())
    data[14] ^= 0xFF
    path.write_bytes(data)
    what, remedy = refused("fusion", *address, "--method", "lira", "--teacher", teacher, "--run", tmp_path)
    assert ("the header of" if teacher == "none" else "already holds a run") in what
    assert remedy
    assert path.read_bytes() == data
    assert list(tmp_path.iterdir()) == [path]


def test_the_log_of_another_robot_is_refused_and_left_as_it_is(address, refused, tmp_path):
    path = write_log(tmp_path / "labels.lira", OTHER)
    before = path.read_bytes()
    what, remedy = refused("fusion", *address, "--method", "hg-dagger", "--run", tmp_path)
    assert "holds demonstrations for 'rosbot2'" in what
    assert "--profile rosbot2" in remedy
    assert path.read_bytes() == before


def test_a_run_that_was_taught_by_another_method_is_refused_and_left_as_it_is(address, refused, tmp_path):
    head = RunRecord("line", PROFILE.name, "plus", "plus", 0, 0, "lira fusion --method plus", "0")
    with RunWriter(tmp_path / "run.jsonl") as record:
        record.write(head)
    before = (tmp_path / "run.jsonl").read_bytes()
    what, remedy = refused("fusion", *address, "--method", "hold", "--run", tmp_path)
    assert what == "lira fusion: this folder was taught by 'plus' on a 'thesis-sim', not by 'hold' on a 'thesis-sim'"
    assert remedy == "  Go on with these, or choose another --run."
    assert (tmp_path / "run.jsonl").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run.jsonl"]


def test_a_folder_that_holds_a_run_is_left_alone(address, refused, tmp_path):
    (tmp_path / "run.jsonl").write_text("what was learned before\n")
    what, remedy = refused("fusion", *address, "--method", "lira", "--teacher", "scripted", "--run", tmp_path)
    assert what == f"lira fusion: {tmp_path} already holds a run"
    assert "--run" in remedy
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [
        ("run.jsonl", "what was learned before\n")
    ]


@pytest.mark.parametrize("teacher", ["none", "perfect"])
def test_a_folder_that_cannot_be_made_is_named(address, refused, tmp_path, teacher):
    (tmp_path / "file").write_text("")
    words = ["--method", "lira", "--teacher", teacher, "--run", tmp_path / "file" / "run"]
    what, remedy = refused("fusion", *address, *words)
    assert "can be no folder" in what
    assert "another folder" in remedy


def test_no_robot_at_the_endpoint_says_how_to_start_one(refused, monkeypatch):
    monkeypatch.setattr(connect, "open_remote", partial(connect.open_remote, answer_s=0.3))
    endpoint = f"127.0.0.1:{free_port()}"
    what, remedy = refused("drive", "--connect", endpoint, "camera-expert")
    assert what == f"lira drive: no robot named 'rosbot' answers 'info' at {endpoint}"
    assert "lira twin" in remedy


@pytest.mark.parametrize(("words", "named"), [(["--connect", "nowhere"], "'nowhere'"), (["--name", "a/b"], "'a/b'")])
def test_an_address_or_a_name_that_is_none_is_refused(refused, words, named):
    assert named in refused("drive", *words, "camera-expert")[0]


@pytest.mark.parametrize(
    ("words", "said", "meant"),
    [
        (["drive", "camera-expert", "--seed", "-1"], "unrecognized arguments: --seed -1", ""),
        (["drive", "camera-expert", "--method", "lira"], "unrecognized arguments: --method lira", ""),
        (["fusion"], "the following arguments are required", ""),
        (["demo", "--layout", "x"], "argument --layout", ""),
        (["demo", "--laps", "-2"], "argument --laps", ""),
        (["demo", "--word=race"], "unrecognized arguments: --word=race", "Did you mean `--world`? "),
        (["twin", "--layout", "-1"], "argument --layout", ""),
        (["train-expert", "sonar"], "argument expert: invalid choice: 'sonar'", ""),
        (["train-expert", "camra"], "argument expert: invalid choice: 'camra'", "Did you mean `camera`? "),
        (["train-expert", "camera", "--task", "corider"], "argument --task: invalid", "Did you mean `corridor`? "),
        (["bench", "latecy"], "argument NAME: invalid choice: 'latecy'", "Did you mean `latency`? "),
        (["new", "methods", "x"], "argument kind: invalid choice: 'methods'", "Did you mean `method`? "),
        (["keys", "enrol", "x"], "argument ACTION: invalid choice: 'enrol'", "Did you mean `enroll`? "),
        (["keys", "--nam", "x"], "argument ACTION: invalid choice", ""),
    ],
)
def test_words_that_make_no_sense_are_refused_in_two_lines(refused, words, said, meant):
    what, remedy = refused(*words)
    assert what.startswith(f"lira {words[0]}: {said}")
    assert remedy.strip().startswith(f"{meant}`lira {words[0]} --help`")


def test_the_demo_refuses_what_is_no_proof_before_it_starts_anything(refused):
    what, remedy = refused("demo", "--proof", "fresh")
    assert what == "lira demo: 'fresh' is no proof"
    assert "fresh:3" in remedy


@pytest.mark.parametrize("option", ["world", "profile"])
def test_the_demo_refuses_an_unknown_world_and_profile_before_it_starts_anything(refused, option):
    what, remedy = refused("demo", f"--{option}", "nosuch")
    assert what == f"lira demo: unknown {option} 'nosuch'"
    assert {"world": "line-obstacles", "profile": "thesis-sim"}[option] in remedy


@pytest.mark.parametrize("verb", ["demo", "twin", "train-expert"])
def test_a_profile_with_an_unknown_key_names_file_and_key(refused, tmp_path, verb):
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\nspeeed = 1\n')
    what, _ = refused(verb, *(["camera"] if verb == "train-expert" else []), "--profile", path)
    assert str(path) in what
    assert "speeed" in what


def test_the_demo_names_a_folder_that_cannot_be_made(refused, tmp_path):
    (tmp_path / "file").write_text("")
    what, remedy = refused("demo", "--run", tmp_path / "file" / "run")
    assert "can be no folder" in what
    assert "another folder" in remedy


@pytest.mark.parametrize(
    ("package", "extra", "words"),
    [
        ("torch", "learn", ["fusion", "--method", "lira"]),
        ("safetensors", "drive", ["drive", "camera-expert"]),
        ("torch", "learn", ["teach", "--method", "hg-dagger"]),
        ("torch", "learn", ["demo", "--method", "lazy-dagger-kernel"]),
        ("safetensors", "drive", ["demo"]),
    ],
)
def test_a_missing_extra_says_what_to_install(package, extra, words, tmp_path):
    done = lira(*words, block=[package], cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"lira {words[0]}: {package} is not installed",
        f"  Install it with: pip install 'lira-rosbot[{extra}]'",
    ]
    assert list(tmp_path.iterdir()) == []
