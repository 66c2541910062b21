"""`lira record` beside a twin: what it hears, what a kill leaves, how it ends."""

import signal
import time
import uuid

import pytest

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, BATTERY, CAMERA, ODOM, SCAN
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.recording.beside import READY
from lira.tools.recording.reader import Recording
from lira.tools.recording.summary import summarise

READY_S = 60.0
LAST_SECOND_S = 1.0


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    name, endpoint = f"rec_{uuid.uuid4().hex}", f"127.0.0.1:{free_port()}"
    words = ["twin", "--world", "line", "--profile", "rosbot2", "--renderer", "sketch"]
    log = tmp_path_factory.mktemp("twin") / "twin.log"
    with ChildProcess("the twin", lira_command(*words, "--name", name, "--listen", endpoint), log) as process:
        process.wait_ready("serves world", READY_S)
        yield name, endpoint


def recorder(twin, folder):
    name, endpoint = twin
    words = ["record", "--name", name, "--connect", endpoint, "--out", str(folder)]
    return ChildProcess("the recorder", lira_command(*words), folder.with_suffix(".log"))


def wait_for(condition, timeout_s=30.0):
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "never happened"
        time.sleep(0.05)


def recorded(folder):
    """How many bytes lie there."""
    return sum(path.stat().st_size for path in folder.glob("*.mcap"))


def test_it_records_every_key_with_what_was_latched_before_it_came_and_ends_at_a_signal(twin, tmp_path, capsys):
    folder = tmp_path / "rec"
    with recorder(twin, folder) as process:
        process.wait_ready(READY, READY_S)
        since_s = time.monotonic()
        # Diagnostics come once a second: pictures may fill as much before the first.
        wait_for(lambda: recorded(folder) > 200_000 and time.monotonic() > since_s + 2.5)
        process.signal(signal.SIGINT)
        assert process.wait(20.0) == 0, process.output()
    summary = summarise(Recording(folder))
    assert {SCAN.key, CAMERA.key, ODOM.key, APPLIED.key, BATTERY.key, "imu", "range/fl", "diagnostics"} <= set(
        summary.topics
    )
    assert not summary.torn
    assert not summary.lost
    assert summary.topics["diagnostics"].missing == 0
    assert 10.0 < summary.topics[ODOM.key].rate_hz < 25.0
    assert (folder / "metadata.yaml").exists()
    assert main(["info", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "(rosbot2) in world 'line', realtime" in out
    assert "sensor_msgs/msg/LaserScan" in out


def test_a_kill_costs_no_more_than_the_last_second(twin, tmp_path, capsys):
    folder = tmp_path / "rec"
    watch = Bus(twin[0], connect=twin[1], watch=True)
    try:
        heard = watch.reader(APPLIED)
        with recorder(twin, folder) as process:
            process.wait_ready(READY, READY_S)
            wait_for(lambda: recorded(folder) > 200_000)
            process.signal(signal.SIGKILL)
            killed_s = heard.newest().message.stamp_s
            process.wait(10.0)
    finally:
        watch.close()
    recording = Recording(folder)
    newest_s = max(each.stamp_s for each in recording.messages(APPLIED))
    assert newest_s >= killed_s - LAST_SECOND_S
    assert recording.torn
    assert main(["record", "--recover", str(folder)]) == 0
    assert "mended" in capsys.readouterr().out
    assert main(["info", str(folder)]) == 0
    assert max(each.stamp_s for each in Recording(folder).messages(APPLIED)) == newest_s


def test_there_is_no_recording_of_a_robot_that_is_not_there(tmp_path, capsys):
    endpoint = f"127.0.0.1:{free_port()}"
    assert main(["record", "--connect", endpoint, "--out", str(tmp_path / "rec")]) == 2
    assert "Check the address" in capsys.readouterr().err
    assert not (tmp_path / "rec").exists()
