import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parent.parent / "conftest.py"
TESTS = {
    "a test that skips": "import pytest\ndef test_it(): pytest.skip('no robot here')\n",
    "a mark": "import pytest\n@pytest.mark.skip(reason='no robot here')\ndef test_it(): pass\n",
    "a module": "import pytest\npytest.skip('no robot here', allow_module_level=True)\n",
}


def run_pytest(folder, *, ci):
    environment = {name: value for name, value in os.environ.items() if name != "CI"} | ({"CI": "true"} if ci else {})
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)],
        check=False, capture_output=True, text=True, timeout=60, env=environment, cwd=folder,
    )  # fmt: skip


@pytest.mark.parametrize("how", TESTS)
def test_an_unexpected_skip_fails_in_ci_and_only_there(tmp_path, how):
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text())
    shutil.copy(CONFTEST.with_name("kinds.py"), tmp_path)
    (tmp_path / "test_it.py").write_text(TESTS[how])
    assert run_pytest(tmp_path, ci=False).returncode in (0, 5)
    done = run_pytest(tmp_path, ci=True)
    assert done.returncode != 0
    assert "no robot here" in done.stdout


def test_an_expected_skip_and_an_expected_failure_pass_in_ci(tmp_path):
    shutil.copy(CONFTEST.with_name("kinds.py"), tmp_path)
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text() + "\n\nEXPECTED_SKIPS = {'no robot here'}\n")
    xfail = "@pytest.mark.xfail(reason='known')\ndef test_other(): assert False\n"
    (tmp_path / "test_it.py").write_text(TESTS["a test that skips"] + xfail)
    done = run_pytest(tmp_path, ci=True)
    assert done.returncode == 0, done.stdout
