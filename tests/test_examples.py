"""Every example runs as it is, in a process of its own, and says what it is meant to say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
SAYS = {
    "01_drive.py": ["camera: ", "careful: ", "it hit a box"],
    "02_my_expert.py": ["training lap 1", "who drove:", "'human': ", "wall active:"],
    "03_my_method.py": ["Settings (Settings) on lane", "training lap 1", "unseen layout 1", "human labels"],
    "04_my_robot.py": ["asked for 0.5 m/s, got 0.5", "asked for 9.0 m/s, got 1.0 ('linear',)"],
    "05_my_sensor.py": ["range_fl: 3."],
    "06_read_a_run.py": ["train ", "prove ", "drivers: [('", "called for feedback at", "stored"],
}


def test_each_is_named_here_and_short():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SAYS)
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) < 40, path.name


def test_the_readme_lists_every_file_and_how_to_run_it():
    rows = re.findall(
        r"^\| \[(.+?)\]\((.+?)\) \| (.+?) \| (.+?) \|$", (EXAMPLES / "README.md").read_text(), re.MULTILINE
    )
    assert [file for file, *_ in rows] == sorted(path.name for path in EXAMPLES.glob("*.*") if path.name != "README.md")
    for file, link, shows, run in rows:
        assert link == file
        assert shows
        assert f"examples/{file}" in run


@pytest.mark.parametrize("name", SAYS)
def test_it_runs_and_says_something(name, tmp_path):
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stderr
    for words in SAYS[name]:
        assert words in done.stdout
