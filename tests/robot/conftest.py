import time

import pytest

PATIENCE_S = 20.0


@pytest.fixture(autouse=True)
def no_long_waits(monkeypatch):
    """Devices are tried again, and resets waited for, without the patience that real ones need."""
    monkeypatch.setattr("lira.robot.supervisor.RETRY_S", 0.2)
    monkeypatch.setattr("lira.robot.rplidar.unit.RESET_S", 0.6)
    monkeypatch.setattr("lira.robot.rosbot.OPEN_S", 6.0)


@pytest.fixture
def failure_of():
    """Asks what a supervisor says of a device that does not open, as soon as the first try has failed."""

    def ask(supervisor):
        supervisor.start()
        until_s = time.monotonic() + PATIENCE_S
        while (failure := supervisor.failure) is None:
            assert not supervisor.alive
            assert time.monotonic() < until_s
            time.sleep(0.01)
        supervisor.close()
        return failure

    return ask
