"""The Python in the READMEs runs as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
FOUND = [
    pytest.param(code, id=f"{path.relative_to(ROOT)}-{number}")
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("[a-z]*/**/README.md")])
    for number, code in enumerate(BLOCK.findall(path.read_text(encoding="utf-8")))
]


def test_there_is_python_to_run():
    assert len(FOUND) >= 3


@pytest.mark.parametrize("code", FOUND)
def test_it_runs(code, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stderr
