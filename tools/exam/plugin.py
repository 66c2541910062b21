"""The pytest plug-in: `lira_twin`, a twin for a test. It loads nothing of weight before a test asks for it."""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from lira.tools.exam.exam import Exam
    from lira.tools.runs.simulated import SimulatedRobot


class LiraTwin:
    """Opens twins in the test's own process, and closes them when the test ends."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack

    def __call__(self, world: str = "line", profile: str | None = None, **words: Any) -> "SimulatedRobot":
        """Open a robot in a world, by name or .toml file, as `lira.simulate` does: for `lira.drive`."""
        from lira.tools.runs.simulated import simulate

        return self._stack.enter_context(simulate(world, profile, **words))

    def exam(self, policy: Any, world: str = "line", profile: str | None = None, **words: Any) -> "Exam":
        """Let a policy drive layouts of a world alone (`layouts`: ten of them), and return how it went.

        `.require(0.9)` of that fails the test if it passed less than nine of ten; printed it says which failed and how.
        """
        from lira.tools.exam.exam import examine

        return examine(policy, world, profile, **words)


@pytest.fixture
def lira_twin() -> Iterator[LiraTwin]:
    """Twins for a test: `lira_twin(world)` opens one, `lira_twin.exam(policy, world)` has a policy drive alone."""
    with ExitStack() as stack:
        yield LiraTwin(stack)
