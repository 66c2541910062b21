"""A recorder beside a run: started with it, ended with it, and never what it fails for."""

import argparse
import contextlib
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

from lira.hal.errors import MissingExtraError
from lira.tools.launch.processes import ChildProcess, ProcessError, lira_command
from lira.tools.recording.layout import FOLDER

READY_S = 30.0
READY = "records '"  # in the line by which `lira record` says that it hears everything
LOG = "record.log"
Say = Callable[[str], None]


@contextlib.contextmanager
def recorder_beside(args: argparse.Namespace, run: Path, say: Say) -> Iterator[Callable[[], None]]:
    """Record the robot at hand into the folder of a run, unless told not to. Yields what waits until all is heard.

    A run goes on without its recording, and says so.
    """
    if args.no_record:
        yield lambda: None
        return
    if find_spec("mcap") is None:
        say(f"not recorded: {MissingExtraError('mcap', 'record')}")
        yield lambda: None
        return
    words = ["record", "--name", args.name, "--connect", args.connect, "--out", str(new_folder(run))]
    with ChildProcess("the recorder", lira_command(*words), run / LOG) as recorder:

        def wait() -> None:
            try:
                recorder.wait_ready(READY, READY_S)
            except ProcessError as error:
                say(f"not recorded: {error}")

        yield wait
        if recorder.status() is not None:
            say(f"the recorder ended before the run did; it wrote:\n{recorder.tail()}")


def new_folder(run: Path) -> Path:
    """Return where the recording of a run goes; one that goes on another day gets one more each time."""
    number = 1
    while (folder := run / (FOLDER if number == 1 else f"{FOLDER}-{number}")).exists():
        number += 1
    return folder
