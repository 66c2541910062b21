"""The suite judges itself: unexpected skips fail in CI, and what fails beside others has to pass alone."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).with_name("conftest.py")
SKIPS = {
    "test_calls.py": "import pytest\ndef test_it(): pytest.skip('no robot here')\n",
    "test_mark.py": "import pytest\n@pytest.mark.skip(reason='no robot here')\ndef test_it(): pass\n",
    "test_module.py": "import pytest\npytest.skip('no robot here', allow_module_level=True)\n",
}
FAILS = "def test_it(): assert False\n"
ALONE = "import pytest\n@pytest.mark.alone\ndef test_alone(): pass\n"
OF_PROCESSES = "import subprocess\n"


def run_pytest(folder, *words, ci=False):
    for name in ("foreign.py", "kinds.py", "loopback.py"):
        shutil.copy(CONFTEST.parent / "support" / name, folder)
    environment = {name: value for name, value in os.environ.items() if name != "CI"} | ({"CI": "true"} if ci else {})
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "ignore", "--rootdir", str(folder), *words, str(folder)],
        check=False, capture_output=True, text=True, timeout=60, env=environment, cwd=folder,
    )  # fmt: skip


def write(folder, files, conftest=""):
    for name, text in {"conftest.py": CONFTEST.read_text() + conftest, **files}.items():
        (folder / name).write_text(text)


def test_an_unexpected_skip_fails_in_ci_and_only_there(tmp_path):
    write(tmp_path, SKIPS)
    assert run_pytest(tmp_path, ci=False).returncode == 0
    done = run_pytest(tmp_path, "--continue-on-collection-errors", ci=True)
    assert done.returncode != 0
    assert done.stdout.count("skipped in CI, which has everything it needs: no robot here") >= len(SKIPS), done.stdout
    assert "skipped" not in done.stdout.splitlines()[-1]


def test_an_expected_skip_and_an_expected_failure_pass_in_ci(tmp_path):
    xfail = "@pytest.mark.xfail(reason='known')\ndef test_other(): assert False\n"
    expected = "\n\nEXPECTED_SKIPS = {'no robot here'}\n"
    write(tmp_path, {"test_it.py": SKIPS["test_calls.py"] + xfail}, expected)
    done = run_pytest(tmp_path, ci=True)
    assert done.returncode == 0, done.stdout


def test_what_fails_waiting_has_to_pass_alone(tmp_path):
    write(tmp_path, {"test_it.py": OF_PROCESSES + FAILS, "test_other.py": ALONE})
    first = run_pytest(tmp_path, "--part", "waiting")
    assert (first.returncode, "1 failed" in first.stdout, "passed" in first.stdout) == (0, True, False), first.stdout
    alone = run_pytest(tmp_path, "--part", "alone")
    assert (alone.returncode, "1 failed, 1 passed" in alone.stdout) == (1, True), alone.stdout


def test_what_fails_computing_has_failed(tmp_path):
    write(tmp_path, {"test_it.py": FAILS, "test_other.py": OF_PROCESSES + FAILS})
    done = run_pytest(tmp_path, "--part", "computing")
    assert (done.returncode, "1 failed" in done.stdout) == (1, True), done.stdout
