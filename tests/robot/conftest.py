import pytest


@pytest.fixture(autouse=True)
def no_long_waits(monkeypatch):
    """Devices are tried again, and resets waited for, without the patience that real ones need."""
    monkeypatch.setattr("lira.robot.supervisor.RETRY_S", 0.2)
    monkeypatch.setattr("lira.robot.rplidar.unit.RESET_S", 0.6)
    monkeypatch.setattr("lira.robot.rosbot.OPEN_S", 6.0)
