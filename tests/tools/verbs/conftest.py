import signal

import pytest


@pytest.fixture(autouse=True)
def _as_it_was():
    """A verb sets it for its whole process, and here that is ours."""
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)
