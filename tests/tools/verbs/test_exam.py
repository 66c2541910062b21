"""A policy's exam, the pytest plug-in, and the page that shows both: its files, in an empty repository."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from lira.hal.errors import ConfigError
from lira.tools.exam.exam import examine
from lira.tools.verbs.teach.new import KINDS, write_project

pytest_plugins = "pytester"

ROOT = Path(__file__).parents[3]
PLUGIN = "lira.tools.exam.plugin"
PAGE = (ROOT / "docs" / "howto" / "ci.md").read_text(encoding="utf-8")
HEAVY = ("numpy", "cv2", "zenoh", "msgspec", "torch", "pybullet")
TIMEOUT_S = 300


def stand(seen):
    return 0.0, 0.0


def files_of_the_page():
    """The files that the page shows, by name: each after a line that begins with its name."""
    found = re.findall(r"^`([\w./]+)`.*?\n```\w+\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    return {f".github/workflows/{name}" if name.endswith(".yml") else name: text for name, text in found}


# The exam


def test_an_exam_counts_what_was_passed_and_says_how_sure_that_is():
    exam = examine("camera-expert", "line", layouts=[1, 2])
    assert (exam.passed, exam.rate, len(exam.laps)) == (2, 1.0, 2)
    assert exam.surely == pytest.approx(0.158, abs=0.001)
    exam.require(1.0)
    assert str(exam).splitlines()[0].startswith("layout 1: passed after ")


def test_who_passes_too_little_is_told_where_and_how():
    exam = examine("camera-expert", "line-obstacles", layouts=[3])
    with pytest.raises(
        AssertionError, match=r"(?s)it passed 0% of the layouts, less than 50%\nlayout 3: failed .*coll"
    ):
        exam.require(0.5)


def test_the_same_numbers_give_the_same_laps():
    first, second = (examine("camera-expert", "line", layouts=[1], seed=4) for _ in range(2))
    assert str(first) == str(second)
    assert first.laps[0].lateral_rms_m == second.laps[0].lateral_rms_m


def test_no_layout_is_an_error():
    with pytest.raises(ConfigError, match="no layout"):
        examine(stand, "line", layouts=[])


# The plug-in


@pytest.fixture
def alone(pytester, monkeypatch):
    """Run tests in a process with this plug-in and no other, in which every warning is an error."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))

    def run(*words):
        return pytester.runpytest_subprocess("-W", "error", "-p", PLUGIN, *words, timeout=TIMEOUT_S)

    return run


def test_it_loads_nothing_of_weight_until_a_test_asks_for_a_twin(pytester, alone):
    pytester.makepyfile(f"""
        import sys

        def test_without():
            assert not [name for name in {HEAVY!r} if name in sys.modules]

        def test_with(lira_twin):
            assert not [name for name in {HEAVY!r} if name in sys.modules]
            lira_twin("line")
            assert "numpy" in sys.modules
    """)
    alone().assert_outcomes(passed=2)


def test_a_twin_is_closed_when_its_test_ends_also_by_a_failure(pytester, alone):
    pytester.makepyfile("""
        from lira.sim_backend.twin import Twin

        closed, really = [], Twin.close

        def close(self):
            closed.append(self)
            really(self)

        Twin.close = close

        def test_that_fails(lira_twin):
            lira_twin("line")
            lira_twin("room")
            assert closed

        def test_that_looks():
            assert len(closed) == 2
    """)
    alone().assert_outcomes(passed=1, failed=1)


def test_an_exam_below_its_floor_fails_the_test_and_is_quoted(pytester, alone):
    pytester.makepyfile("""
        def test_it_moves(lira_twin):
            lira_twin.exam(lambda seen: (0.0, 0.0), "line", layouts=[1]).require(1.0)
    """)
    result = alone()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*it passed 0% of the layouts, less than 100%*"])


def test_the_package_names_the_plug_in():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"lira": PLUGIN}


# The page


def test_the_files_of_the_page_pass_in_an_empty_repository(pytester, alone):
    for name, text in files_of_the_page().items():
        path = pytester.path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    alone().assert_outcomes(passed=2)


def test_the_page_shows_the_workflow_that_lira_new_writes(tmp_path):
    written = write_project("world", "my-hall", tmp_path / "my-hall")
    workflow = tmp_path / "my-hall" / ".github" / "workflows" / "lira.yml"
    assert workflow in written
    assert files_of_the_page()[".github/workflows/lira.yml"] == workflow.read_text(encoding="utf-8")


def test_a_workflow_installs_a_part_that_there_is(tmp_path):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for kind, about in KINDS.items():
        assert about.part in project["optional-dependencies"]
        write_project(kind, f"a-{kind}", tmp_path / kind)
        workflow = (tmp_path / kind / ".github" / "workflows" / "lira.yml").read_text(encoding="utf-8")
        assert f'"lira-rosbot[{about.part}]"' in workflow


@pytest.mark.slow
def test_the_wheel_has_the_plug_in_in_a_repository_that_knows_nothing_of_lira(tmp_path):
    copy, repository, environment = tmp_path / "clone", tmp_path / "repository", tmp_path / "venv"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in filter(None, listed.stdout.decode().split("\0")):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, copy / name, follow_symlinks=False)
    wheel = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(tmp_path)]
    subprocess.run([*wheel, str(copy)], check=True, timeout=TIMEOUT_S)
    venv.create(environment, with_pip=False, symlinks=True)
    site = next((environment / "lib").glob("python3*")) / "site-packages"
    # What it needs comes from here; lira itself comes from the wheel, which stands first.
    (site / "needed.pth").write_text(str(Path(pytest.__file__).parents[1]))
    for each in tmp_path.glob("*.whl"):
        zipfile.ZipFile(each).extractall(site)
    for name, text in files_of_the_page().items():
        (repository / name).parent.mkdir(parents=True, exist_ok=True)
        (repository / name).write_text(text, encoding="utf-8")
    (repository / "test_where.py").write_text(
        f"import lira\ndef test_it(): assert lira.__file__.startswith({str(site)!r})\n"
    )
    done = subprocess.run(
        [environment / "bin" / "python", "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider"],
        cwd=repository, check=False, capture_output=True, text=True, timeout=TIMEOUT_S,
        env={"PATH": os.environ["PATH"], "HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout
