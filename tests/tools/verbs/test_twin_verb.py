import signal

import msgspec
import pytest
from fresh import lira

from lira.hal.bus.bus import Bus
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, Twist
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.world import World
from lira.tools.launch.processes import ChildProcess, free_port, lira_command


def test_an_unknown_world_names_the_known_ones_before_anything_heavy_is_loaded():
    done = lira("twin", "--world", "nosuch", block=["pybullet", "zenoh", "torch", "cv2", "rosbags"])
    assert done.returncode == 2
    what, remedy = done.stderr.splitlines()
    assert what == "lira twin: unknown world 'nosuch'"
    assert "line-obstacles" in remedy
    assert "race" in remedy


def test_an_unknown_profile_names_the_known_ones():
    done = lira("twin", "--profile", "nosuch")
    assert done.returncode == 2
    assert "rosbot2, thesis-sim" in done.stderr


def test_a_lidar_is_one_of_those_that_there_are_and_goes_with_the_wire(tmp_path):
    done = lira("twin", "--wire", str(tmp_path), "--lidar", "a2m9", "--profile", "rosbot2", "--world", "room")
    assert done.returncode == 2
    assert "there is no lidar 'a2m9'" in done.stderr
    assert "a2m8-1.20, a2m8-1.29, a2m7, a2m12, a1, a3" in done.stderr
    alone = lira("twin", "--lidar", "a3")
    assert alone.returncode == 2
    assert "--lidar goes with --wire" in alone.stderr


def test_a_world_file_with_a_typo_names_file_and_key(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('description = "x"\n[limits]\nlost_m = 1.0\nfinish_m = 5.0\nfinnish_m = 1.0\n')
    done = lira("twin", "--world", str(path))
    assert done.returncode == 2
    assert str(path) in done.stderr
    assert "finnish_m" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_pybullet_it_says_what_to_do_if_it_is_asked_for():
    done = lira("twin", "--renderer", "tiny", block=["pybullet"])
    assert done.returncode == 2
    complaint, remedy = done.stderr.splitlines()
    assert complaint == "lira twin: pybullet is not installed"
    assert remedy.startswith("  Use the renderer 'sketch'")


@pytest.mark.parametrize("words", [["--lockstep"], ["--speed", "2"]])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_says_when_it_is_ready_and_stops_cleanly_when_told(tmp_path, words, number):
    port = free_port()
    command = lira_command("twin", "--name", f"verb_{port}", "--listen", f"127.0.0.1:{port}", *words)
    with ChildProcess("the twin", command, tmp_path / "log") as twin:
        line = twin.wait_ready("serves world", 60.0)
        pace = "lockstep" if "--lockstep" in words else "2 times real time"
        where = f"world 'line' (thesis-sim, drawn by pybullet) on 127.0.0.1:{port}"
        assert line == f"twin 'verb_{port}' serves {where}, {pace}; stop with Ctrl-C"
        twin.signal(number)
        assert twin.wait(20.0) == 0
    assert "Traceback" not in twin.output()


def test_a_port_in_use_and_a_name_in_use_are_refused(tmp_path):
    port, other = free_port(), free_port()
    name = f"verb_{port}"
    command = lira_command("twin", "--name", name, "--listen", f"127.0.0.1:{port}")
    with ChildProcess("the twin", command, tmp_path / "log") as twin:
        twin.wait_ready("serves world", 60.0)
        same_port = lira("twin", "--name", "another", "--listen", f"127.0.0.1:{port}")
        assert same_port.returncode == 2
        assert f"127.0.0.1:{port} is already in use" in same_port.stderr
        same_name = lira("twin", "--name", name, "--listen", f"127.0.0.1:{other}")
        assert same_name.returncode == 2
        assert f"a robot named '{name}' already" in same_name.stderr


def test_whoever_connects_learns_the_world_and_can_drive(tmp_path):
    port = free_port()
    name, endpoint = f"verb_{port}", f"127.0.0.1:{port}"
    words = ["--world", "race", "--layout", "4", "--randomise", "--lockstep"]
    command = lira_command("twin", "--name", name, "--listen", endpoint, *words)
    with ChildProcess("the twin", command, tmp_path / "log") as twin:
        twin.wait_ready("serves world", 60.0)
        bus = Bus(name, connect=endpoint)
        robot = open_remote(bus)
        arena = robot.arena
        world = msgspec.structs.replace(load_world("race"), randomised=True)
        assert msgspec.json.decode(arena.info, type=World) == world
        before = arena.state()
        for twist in (STOP, *[Twist(0.5, 0.0)] * 5):
            robot.drive(Command(twist, robot.now(), answers=robot.read().seq))
            robot.wait(robot.now() + robot.profile.period_s)
        assert arena.state().x_m - before.x_m == pytest.approx(0.5, abs=0.15)
        robot.close()
        bus.close()


def test_a_world_in_which_the_real_lidar_would_be_blind_is_refused(tmp_path):
    words = ["--wire", str(tmp_path), "--profile", "rosbot2", "--renderer", "tiny"]
    done = lira("twin", "--world", "garden", *words)
    assert done.returncode == 2
    what, remedy = done.stderr.splitlines()[-2:]
    assert "in world 'garden' the lidar of 'rosbot2' gets an echo from" in what
    assert "--wire" in remedy
    assert not list(tmp_path.iterdir())
