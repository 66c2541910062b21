"""How the suite is run: its parts, and what a skip means in CI.

`--part computing` is what only computes, `--part waiting` what starts processes and mostly waits for them, each on
several workers (`suite.py`). A test that fails waiting may have lacked the time that it needs: it is left open, and has
to pass with `--part alone`, which runs that and what is marked `alone`, one after the other. More than a few are a
failure at once.

In CI (`CI=true`) a skipped test fails unless its reason is expected: a suite that skips itself proves nothing.
Property tests try the same examples in every run; `pytest --hypothesis-profile=explore` looks for new ones.
"""

import gc
import hashlib
import os
import signal
import sys
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from foreign import NOT_INSTALLED
from hypothesis import settings
from kinds import TAKES_LONG, kind_of
from loopback import take_own_loopback

# The tests share the processors, and small matrices multiply no faster on several threads, which wait for each other.
# As whoever teaches does it: sums depend on it.
os.environ["OMP_NUM_THREADS"] = "1"
# A shell that runs the suite in the background ignores SIGINT, and nohup SIGHUP; so would every process that a test
# starts. What is handled here is as ever there.
signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda *_: None)

settings.register_profile("steady", derandomize=True)
settings.register_profile("explore")
settings.load_profile("steady")

# Contract tests that have no meaning for one of the adapters.
EXPECTED_SKIPS = {
    "over the bus in real time the answer is a step behind",
    "in lockstep silence stops time",
    "no package index answers",
    "no client of others is installed",
    *NOT_INSTALLED,
    TAKES_LONG,
}
PARTS = ("computing", "waiting", "alone")
OPEN = "lira/open"  # in pytest's cache: what failed waiting
MOST_OPEN = 40
_failed: set[str] = set()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the parts of a run."""
    parser.addoption("--part", choices=PARTS, help="only what computes, what waits for processes, or what runs alone")


def pytest_configure(config: pytest.Config) -> None:
    """Keep a worker to itself."""
    if hasattr(config, "workerinput") and sys.platform == "linux":
        take_own_loopback()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import what has no test of this run: all imports together take longer than the unit tests."""
    if not collection_path.match("test_*.py"):
        return None
    kind, part = kind_of(collection_path), config.getoption("part")
    if config.getoption("markexpr") == "unit" and kind != "unit":
        return True
    if part in ("computing", "waiting") and (kind == "processes") != (part == "waiting"):
        return True
    if part == "alone":
        inside = f"{collection_path.relative_to(config.rootpath).as_posix()}::"
        left_open = any(name.startswith(inside) for name in config.cache.get(OPEN, []))
        return None if left_open or "mark.alone" in collection_path.read_text(encoding="utf-8") else True
    return None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark every test by its kind (`kinds.py`), and choose those of this part of the run.

    Where several run beside each other the slow files come first, so that what is left in the end is short; the others
    follow in an order of chance, always the same: those of one folder would all wait at a time.
    """
    for item in items:
        item.add_marker(kind_of(item.path))
    if config.getoption("part") == "alone":
        left_open = config.cache.get(OPEN, [])
        items[:] = [item for item in items if item.get_closest_marker("alone") or item.nodeid in left_open]
    elif config.getoption("part"):
        items[:] = [item for item in items if item.get_closest_marker("alone") is None]
        items.sort(key=lambda item: (item.get_closest_marker("slow") is None, _chance(item.location[0])))


def _chance(file: str) -> str:
    return hashlib.sha1(file.encode(), usedforsecurity=False).hexdigest()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import and collect. All of that stays: to look there for garbage takes seconds, now and during the tests."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note what failed."""
    if report.failed:
        _failed.add(report.nodeid)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave open what failed waiting."""
    config = session.config
    if config.getoption("part") != "waiting" or hasattr(config, "workerinput"):
        return
    config.cache.set(OPEN, sorted(_failed))
    if session.exitstatus == pytest.ExitCode.TESTS_FAILED and len(_failed) <= MOST_OPEN:
        session.exitstatus = pytest.ExitCode.OK


@pytest.fixture(autouse=True, scope="session")
def lock_files_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Robots lock their names in the temporary folder: those of one worker are no other's, and do not pile up."""
    with pytest.MonkeyPatch.context() as patch:
        folder = str(tmp_path_factory.mktemp("locks"))
        patch.setenv("TMPDIR", folder)
        patch.setattr(tempfile, "tempdir", folder)
        yield


@pytest.fixture(autouse=True, scope="session")
def as_nice_as_it_began() -> Iterator[None]:
    """A verb that gives way to others does not do so for the tests that come after it in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "nice", lambda _: 0)
        yield


def fail_if_unexpected(report: pytest.TestReport | pytest.CollectReport) -> None:
    """Turn a skip into a failure, unless it is expected."""
    if not report.skipped or hasattr(report, "wasxfail") or not isinstance(report.longrepr, tuple):
        return
    reason = report.longrepr[2].removeprefix("Skipped: ")
    if reason not in EXPECTED_SKIPS:
        report.outcome = "failed"
        report.longrepr = f"skipped in CI, which has everything it needs: {reason}"


if os.environ.get("CI") == "true":

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Judge the skips of tests."""
        report = yield
        fail_if_unexpected(report)
        return report

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Judge the skips of whole modules."""
        report = yield
        fail_if_unexpected(report)
        return report
