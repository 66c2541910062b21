"""In CI (`CI=true`) a skipped test fails unless its reason is expected: a suite that skips itself proves nothing.

Property tests try the same examples in every run; `pytest --hypothesis-profile=explore` looks for new ones.
"""

import os
import signal
from collections.abc import Generator

import pytest
from hypothesis import settings
from kinds import kind_of

# A shell that runs the suite in the background ignores SIGINT, and so would every process that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("steady", derandomize=True)
settings.register_profile("explore")
settings.load_profile("steady")

# Contract tests that have no meaning for one of the adapters.
EXPECTED_SKIPS = {
    "over the bus in real time the answer is a step behind",
    "in lockstep silence stops time",
    "no package index answers",
}


def fail_if_unexpected(report: pytest.TestReport | pytest.CollectReport) -> None:
    """Turn a skip into a failure, unless it is expected."""
    if not report.skipped or hasattr(report, "wasxfail") or not isinstance(report.longrepr, tuple):
        return
    reason = report.longrepr[2].removeprefix("Skipped: ")
    if reason not in EXPECTED_SKIPS:
        report.outcome = "failed"
        report.longrepr = f"skipped in CI, which has everything it needs: {reason}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test by its kind (`kinds.py`)."""
    for item in items:
        item.add_marker(kind_of(item.path))


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
