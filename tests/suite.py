"""Every test, in three parts: what computes gives way to what waits, beside it, and what measures time comes last.

    python tests/suite.py

Most tests wait for processes, so more of those run beside each other than there are processors. Those of a file stay
together, and share what it starts. What computes takes the time that they leave.
"""

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

WAITING, COMPUTING = 5, 2  # workers
FILE_BY_FILE = ("--dist", "loadfile", "--no-loadscope-reorder")
LEAST = 19  # niceness


def pytest(part: str, workers: int = 0) -> list[str]:
    """The command that runs one part."""
    beside = ["--numprocesses", str(workers), *FILE_BY_FILE] if workers else []
    return [sys.executable, "-m", "pytest", "--part", part, *beside]


def give_way() -> None:
    """Let everybody else have the processor first, also where Linux shares it out by sessions."""
    os.nice(LEAST)
    with suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(LEAST))


def main() -> int:
    """Run it, and return the exit status of the first part that failed."""
    with tempfile.TemporaryFile("w+") as told:
        computing = subprocess.Popen(
            pytest("computing", COMPUTING),
            stdout=told,
            stderr=told,
            start_new_session=True,
            preexec_fn=give_way,  # noqa: PLW1509 - there is no thread yet
        )
        try:
            waiting = subprocess.run(pytest("waiting", WAITING), check=False).returncode
            computed = computing.wait()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(computing.pid, signal.SIGTERM)
        told.seek(0)
        print(told.read(), flush=True)
    return computed or waiting or subprocess.run(pytest("alone"), check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
