"""A process that is asked to end does so, whatever the signal interrupts and however many come at once."""

import pytest
from fresh import python

# In the middle of `wait` or `set` the main thread holds the event's lock.
HELD = """
import os, signal
from {module} import {context}
with {context}() as stop:
    with stop._cond:
        os.kill(os.getpid(), signal.SIGTERM)
    print(stop.wait(5.0))
"""


@pytest.mark.parametrize(
    ("module", "context"),
    [("lira.hal.signals", "stop_on_signal"), ("lira.tools.launch.lifetime", "stop_or_interrupt")],
)
def test_a_signal_waits_for_nothing_that_it_interrupts(module, context):
    done = python(HELD.format(module=module, context=context))
    assert (done.stdout, done.returncode) == ("True\n", 0), done.stderr
