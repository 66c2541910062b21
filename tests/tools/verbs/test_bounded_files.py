"""Whatever file a verb is given: it ends at once, with one line and its remedy, and exit status 2."""

import os
import time

import pytest

from lira.sim_backend.catalogue import load_world
from lira.tools.cli import main
from lira.tools.joystick.known_pads import PadMemory

AT_ONCE_S = 20.0  # what reads without end takes longer

VERBS = {
    "world": ["world", "{file}", "--picture", "{folder}/out.png"],
    "twin": ["twin", "--world", "{file}"],
    "profile": ["world", "line", "--profile", "{file}", "--picture", "{folder}/out.png"],
    "robot": ["robot", "--base", "x", "--lidar", "y", "--without", "camera", "--settings", "{file}"],
    "calibrate": ["calibrate", "base", "--base", "x", "--settings", "{file}", "--yes"],
    "joystick": ["joystick", "--pad", "{file}"],
    "labels": ["labels", "check", "{file}"],
    "report": ["report", "{folder}"],
}
FILES = {
    "pipe": os.mkfifo,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "huge": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 2**30),
    "nested": lambda path: path.write_text("value = " + "[" * 100_000),
    "nested json": lambda path: path.write_text("[" * 100_000),
    "no text": lambda path: path.write_bytes(os.urandom(5000)),
    "folder": lambda path: path.mkdir(),
}


@pytest.mark.parametrize("content", FILES)
@pytest.mark.parametrize("verb", VERBS)
def test_a_file_that_is_none_is_one_line_and_exit_2(tmp_path, capsys, verb, content):
    file = tmp_path / ("run.jsonl" if verb == "report" else "file.toml")
    FILES[content](file)
    began_s = time.monotonic()
    assert main([word.format(file=file, folder=tmp_path) for word in VERBS[verb]]) == 2
    assert time.monotonic() - began_s < AT_ONCE_S
    said = capsys.readouterr()
    what, remedy = said.err.splitlines()
    assert what.startswith("lira ")
    assert len(what) < 1000
    assert remedy.startswith("  ")


WORLD = """
description = "too much"
[limits]
lost_m = 1.0
finish_m = 10.0
"""


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[line]\nrepeat = 1000\npieces = [{straight_m = 1000.0}]", "too long"),
        ("[line]\nrepeat = 1000\npieces = [" + "{straight_m = 0.001}," * 100 + "]", "too long"),
        ("[[area]]\ncount = 1000\nx_m = [0, 900]\ny_m = [0, 900]\n" * 2, "2000 boxes are more than 1000"),
        ("[[tiles]]\nx_m = [0, 1]\ny_m = [0, 1]\n" * 101, "length <= 100"),
    ],
)
def test_a_world_that_nobody_could_lay_out_is_refused(tmp_path, capsys, text, why):
    path = tmp_path / "mine.toml"
    path.write_text(WORLD + text)
    assert main(["world", str(path), "--picture", str(tmp_path / "out.png")]) == 2
    assert why in capsys.readouterr().err


@pytest.mark.parametrize("progress_m", [1e308, -1e308, float("nan"), float("inf")])
def test_there_is_no_place_beyond_all_floors(progress_m):
    from lira.sim_backend.layout import build

    with pytest.raises(ValueError, match="no floor"):
        build(load_world("line")).curve.pose(progress_m)


@pytest.mark.parametrize("content", [b"{", b"[" * 100_000, b'{"pad": {"timeout_s": -1}}', b"\xff" * 100])
def test_pads_that_cannot_be_read_are_kept_and_begin_anew(tmp_path, content):
    path, said = tmp_path / "pads.json", []
    path.write_bytes(content)
    memory = PadMemory(path, said.append)
    memory.keep("mine", 0.3)
    assert len(said) == 1
    assert (tmp_path / "pads.json.damaged").read_bytes() == content
    assert PadMemory(path).timeout_s("mine") == 0.3
