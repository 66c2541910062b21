"""How the process of a verb ends: at a signal, when nobody hears it any more, out of memory, with a dead link."""

import atexit
import contextlib
import errno
import os
import select
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import NoReturn

from lira.hal.errors import LiraError, StorageError
from lira.hal.signals import asked, handling, heeded, set_from_handler

PATIENCE_S = 1.5
LOOK_S = 0.2
EXIT_SIGNAL = 128  # and the signal's number
# A client closes its bus within that: on a dead link it takes seconds, and `process` does not wait for it.
CLOSE_S = 0.5
# What the system says when it does not take what is written, and no file is to blame that anybody has named.
UNWRITABLE = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EBADF)
SCARCE = ("allocate memory", "start new thread", "failed to map segment")


class Interrupted(KeyboardInterrupt):
    """A signal that asks the process to end, in the main thread: every `finally` runs."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let a kill, and a terminal that goes away, end what runs in the main thread as Ctrl-C does.

    A server takes its signals itself (`hal.signals.stop_on_signal`). What a shell told the process to ignore, it
    ignores.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature is Python's
        if not asked.again():
            raise Interrupted(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked.forget()
    with handling(interrupt, *heeded(signal.SIGINT, signal.SIGTERM, signal.SIGHUP)):
        yield


@contextlib.contextmanager
def stop_or_interrupt() -> Iterator[threading.Event]:
    """Give an event that a signal sets, for a client's loop; whoever does not heed it in time is interrupted.

    A robot that is away, frozen or slow keeps a client waiting for longer than a person waits for the client.
    """
    stop, by = threading.Event(), [int(signal.SIGINT)]

    def ask(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature is Python's
        if not asked.again():
            by[0] = number
            signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
            set_from_handler(stop)

    def insist(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
        raise Interrupted(by[0])

    asked.forget()
    numbers = (signal.SIGINT, signal.SIGTERM, *heeded(signal.SIGHUP))
    with handling(ask, *numbers), handling(insist, signal.SIGALRM):
        try:
            yield stop
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextlib.contextmanager
def saving(snapshot: Callable[[], Callable[[], str]], say: Callable[[str], None]) -> Iterator[None]:
    """Save at the end and say what was saved, whatever ends it; what ended it is raised, not what comes after.

    `snapshot` takes what there is then, and returns the writing of it (`tools.run_folder.snapshot`).
    """
    try:
        yield
    except BaseException:
        with contextlib.suppress(LiraError, OSError):
            say(snapshot()())
        raise
    say(snapshot()())


@contextlib.contextmanager
def heard() -> Iterator[None]:
    """End the process in an orderly way, as by a signal, when nobody reads its standard output any more.

    That shows in a pipe at once, and else when a thread writes in vain. Nobody would know of a server that went on.
    Raises what was met, `OSError`.
    """
    lost: list[OSError] = []
    before, done = threading.excepthook, threading.Event()

    def end(error: OSError) -> None:
        lost.append(error)
        os.kill(os.getpid(), signal.SIGTERM)  # not raise_signal: the main thread has to wake up

    def hook(arguments: threading.ExceptHookArgs) -> None:
        error = arguments.exc_value
        if isinstance(error, BrokenPipeError) or (isinstance(error, OSError) and is_unwritable(error)):
            end(error)
        else:
            before(arguments)

    def look(pipe: select.poll) -> None:
        while not done.wait(LOOK_S):
            if pipe.poll(0):
                end(BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)))
                return

    threading.excepthook = hook
    if _is_pipe(1):
        pipe = select.poll()
        pipe.register(1, 0)  # whether it is broken is told unasked
        threading.Thread(target=look, args=[pipe], name="output", daemon=True).start()
    try:
        yield
    except Interrupted:
        if not lost:
            raise
    finally:
        done.set()
        threading.excepthook = before
    if lost:
        raise lost[0]


def claim_descriptors() -> None:
    """Have something behind the three standard descriptors: else the next file that is opened becomes one of them.

    Then whatever a library prints would go into that file. Raises `StorageError` if there is no standard output.
    """
    closed = [number for number in (0, 1, 2) if not _is_open(number)]
    for _ in closed:
        os.open(os.devnull, os.O_RDWR)  # the lowest that is free
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115 - as long as the process
    if 1 in closed or sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        raise StorageError("standard output is closed", "Send it somewhere, if only to /dev/null.")


def abandon_output() -> None:
    """Give what is still buffered for standard output somewhere to go: Python writes it once more at its end."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def is_unwritable(error: OSError) -> bool:
    """Whether a write failed, to something that has no name."""
    return error.filename is None and error.errno in UNWRITABLE


def unwritable(error: OSError) -> LiraError:
    """What to tell about it."""
    return StorageError(f"cannot write the output: {error.strerror}", "Free some space, or send it elsewhere.")


def out_of_memory(error: BaseException) -> LiraError | None:
    """What to tell about an error that says that the machine has not enough; None for another one."""
    if not isinstance(error, MemoryError) and not any(words in str(error) for words in SCARCE):
        return None
    return LiraError("there is not enough memory", "End other programs, or raise the limit (ulimit -v).")


def process(work: Callable[[], int]) -> NoReturn:
    """Do the work, then end the process with its status and what was registered for the end, but nothing else.

    To take Python apart object by object takes seconds where PyTorch is loaded, and Python aborts when a thread comes
    out of zenoh meanwhile. Who asks once more ends it at once.
    """
    status: int | None = None

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature is Python's
        if status is None:  # the work has not begun
            os._exit(EXIT_SIGNAL + number)
        if not asked.again():
            os._exit(status)

    with handling(end, *heeded(signal.SIGINT, signal.SIGTERM, signal.SIGHUP)):
        status = work()
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(status)


def _is_pipe(number: int) -> bool:
    return _is_open(number) and stat.S_ISFIFO(os.fstat(number).st_mode)


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True
