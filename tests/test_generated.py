"""What the documents take from the code is what the code says today."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_the_documents_say_what_the_code_does():
    found = subprocess.run(
        [sys.executable, "docs/generate.py"], cwd=ROOT, check=False, capture_output=True, text=True, timeout=60
    )
    assert (found.returncode, found.stdout) == (0, "up to date\n"), "run: make generated"
