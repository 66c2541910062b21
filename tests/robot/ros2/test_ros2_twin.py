"""`lira twin --ros2` beside a peer of rmw_zenoh that nobody here wrote, and what its end costs the robot."""

import json
import os
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest
from foreign import foreign_environment, ros_share, sdk_command

from lira.hal.client.connect import connect
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

PEER = Path(__file__).with_name("sdk_peer.py")
READY = "ZENOH_CONFIG_OVERRIDE="


@contextmanager
def twin(tmp_path):
    """A twin that is offered to a graph of its own: its name, its port on the bus, the graph's, its process."""
    bus, graph = free_port(), free_port()
    name = f"twin_{bus}"
    words = ["twin", "--name", name, "--listen", f"127.0.0.1:{bus}", "--world", "room", "--renderer", "sketch"]
    words += ["--ros2", f"own:127.0.0.1:{graph}", "--ros2-domain", "0"]
    with ChildProcess("the twin", lira_command(*words), tmp_path / "twin.log") as process:
        process.wait_ready(READY, 60.0)
        yield name, bus, graph, process
        assert process.stop() == 0
    assert "Traceback" not in process.output()


def test_a_peer_that_nobody_here_wrote_lists_it_hears_it_and_drives_it(tmp_path):
    command = sdk_command(PEER)
    with twin(tmp_path) as (_, _, graph, _):
        words = [*command, str(graph), str(ros_share()), "9"]
        done = subprocess.run(words, capture_output=True, env=foreign_environment(), timeout=120, check=False)
    assert done.returncode == 0, done.stderr.decode()
    met = json.loads(done.stdout.splitlines()[-1])
    assert met["topics"]["/scan"] == ["sensor_msgs/msg/LaserScan"]
    assert met["topics"]["/tf_static"] == ["tf2_msgs/msg/TFMessage"]
    assert met["topics"]["/cmd_vel"] == ["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"]
    assert met["services"]["/estop/press"] == ["std_srvs/srv/Trigger"]
    assert met["scan"][0] == "laser"
    assert met["scan"][1] > 50
    assert ["odom", "base_link"] in met["tf"]
    assert bytes.fromhex(met["picture"][1]) in (b"\xff\xd8\xff", b"\x89PN")
    assert met["fastest"] == pytest.approx(0.2, abs=0.05)
    assert met["odom"] > 0.1
    assert 0.0 <= min(met["clock"]) < 0.3  # stamps are of now, in Unix time
    assert met["press"][0]
    assert met["press"][1].startswith("emergency")


def test_what_does_not_go_together_is_refused_before_anything_moves(monkeypatch, capsys):
    for words, what in [
        (["--lockstep"], "--ros2 is for a robot on the bus in real time"),
        (["--ros2-namespace", "a", "--ros2", "elsewhere:7447"], "anybody in the ROS 2 graph of elsewhere:7447"),
        (["--ros2", "nowhere"], "'nowhere' is no address"),
    ]:
        assert main(["twin", "--listen", "127.0.0.1:1", "--ros2", *words]) == 2
        assert what in capsys.readouterr().err
    monkeypatch.setenv("LIRA_KEYS", "keys/robot")
    assert main(["twin", "--listen", "127.0.0.1:1", "--ros2"]) == 2
    assert "lira keys enroll ros" in capsys.readouterr().err


def test_what_offers_it_may_be_killed_and_the_robot_stands_and_goes_on(tmp_path):
    with twin(tmp_path) as (name, bus, _, process):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        (offer,) = [
            int(pid) for pid in children if b"--offer" in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        ]
        os.kill(offer, signal.SIGKILL)
        with connect(f"127.0.0.1:{bus}", name) as robot:
            assert robot.read() is not None
        assert process.status() is None
