"""A robot whose ROS 2 runs rmw_zenoh is driven by its own middleware, and its other nodes see a node like them."""

import time
from contextlib import closing

import pytest
import zenoh
from rmw_peer import HASHES, TWIST, UNHASHED, RmwPeer, open_session
from ros2_peer import twist_cdr
from ros2_rig import PROFILE, get_going, served, wait_for
from trigger import REQUEST, read_answer
from zenoh import ext

from lira.hal.bus.topics import BATTERY, CMD_VEL, SCAN
from lira.hal.errors import BusError, ConfigError
from lira.hal.messages import BatteryState, Twist
from lira.hal.rmw.services import Answer
from lira.hal.rmw.tokens import Kind
from lira.hal.ros_graph.look import look
from lira.hal.ros_graph.node import RosNode
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.robot.ros2.transport import RMW
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command


def test_every_command_has_the_attachment_without_which_it_would_be_dropped():
    with served(namespace="robot1", rmw=True, domain=7) as (robot, client):
        get_going(client)
        wait_for(lambda: robot.commands and robot.commands[-1][1] == twist_cdr(0.3, 0.5))
    assert robot.refused == []
    assert robot.numbers == list(range(1, len(robot.numbers) + 1))
    assert robot.commands[-1][1] == twist_cdr(0.0, 0.0)


def test_a_robot_that_hashes_nothing_is_heard_and_driven_once_that_is_known():
    with served(rmw=True, hashed=False, hashes={"geometry_msgs/msg/Twist": UNHASHED}) as (robot, client):
        get_going(client)
        wait_for(lambda: robot.commands and robot.commands[-1][1] == twist_cdr(0.3, 0.5))
    assert robot.refused == []


def test_it_is_a_node_that_others_see_with_all_that_it_says_and_hears():
    with served(rmw=True, namespace="robot1") as (robot, _):
        seen = look(f"127.0.0.1:{robot.port}")
    assert {node.name for node in seen.nodes} == {"rosbot", "lira"}
    ours = {(each.kind, each.name): each for each in seen.endpoints if each.node.name == "lira"}
    assert ours[Kind.PUBLISHER, "/robot1/cmd_vel"].type_hash == HASHES[TWIST]
    assert ours[Kind.SUBSCRIPTION, "/robot1/scan"].ros_type == "sensor_msgs/msg/LaserScan"
    assert all(each.node.namespace == "/robot1" for each in ours.values())
    numbers = [each.number for each in ours.values()]
    assert len(set(numbers)) == len(numbers)


def test_what_is_latched_reaches_a_subscriber_that_comes_later_and_every_node_that_listens():
    port = free_port()
    with (
        closing(RosNode("lira", listen=f"127.0.0.1:{port}")) as node,
        closing(open_session("peer", connect=port)) as session,
    ):
        publisher = node.publisher(BATTERY)
        publisher.put(BatteryState(1.0, 11.5), 1.0)
        (endpoint,) = (each for each in look(f"127.0.0.1:{port}").endpoints)
        assert (endpoint.qos.latched, endpoint.qos.reliable, endpoint.qos.depth) == (True, True, 1)
        came = []
        # As rmw_zenoh subscribes to what is transient local and reliable.
        late = ext.declare_advanced_subscriber(
            session,
            endpoint.key,
            came.append,
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=ext.RecoveryConfig(heartbeat=True),
            subscriber_detection=True,
        )
        wait_for(lambda: came)
        assert len(bytes(came[0].attachment)) == 33
        publisher.put(BatteryState(2.0, 11.4), 2.0)
        wait_for(lambda: len(came) > 1)
        assert [bytes(each.payload)[4:8] for each in came] == [b"\1\0\0\0", b"\2\0\0\0"]
        del late


def test_a_service_is_answered_with_the_number_and_the_id_that_came():
    port, pressed = free_port(), []
    with (
        closing(RosNode("lira", listen=f"127.0.0.1:{port}")) as node,
        closing(open_session("peer", connect=port)) as session,
    ):

        def press():
            pressed.append(1)
            return Answer(True, "stopped")

        service = node.service("estop/press", press)
        (endpoint,) = (each for each in look(f"127.0.0.1:{port}").endpoints)
        assert (endpoint.kind, endpoint.name) == (Kind.SERVICE, "/estop/press")
        for payload, attachment in [
            (REQUEST, bytes(range(8)) + bytes(8) + b"\x10" + bytes(range(16))),
            (b"", None),
            (b"garbage", b"garbage"),
        ]:
            replies = session.get(
                endpoint.key,
                zenoh.handlers.FifoChannel(4),
                payload=payload,
                attachment=attachment,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                timeout=5.0,
            )
            wait_for(lambda: service.serve() or len(pressed))
            (reply,) = list(replies)
            assert read_answer(bytes(reply.ok.payload)) == (True, "stopped")
            told = bytes(reply.ok.attachment)
            assert len(told) == 33
            if payload and attachment != b"garbage":
                assert (told[:8], told[17:]) == (attachment[:8], attachment[17:])
            pressed.clear()


def test_garbage_on_its_keys_tokens_and_attachments_costs_nobody_anything():
    port = free_port()
    with (
        closing(RosNode("lira", listen=f"127.0.0.1:{port}")) as node,
        closing(open_session("peer", connect=port)) as session,
    ):
        scans = node.reader(SCAN)
        tokens = ["@ros2_lv/0/x", "@ros2_lv/0/x/y/z/MP/%/%/n/%t/a/b/c", "@/x/@ros2_lv/MP/§§/x/:::", "@ros2_lv/é/*/x"]
        held = [session.liveliness().declare_token(each) for each in tokens if "*" not in each]
        key = f"0/scan/sensor_msgs::msg::dds_::LaserScan_/{UNHASHED}"
        for payload, attachment in [
            (b"", None),
            (b"\0\1\0\0", b"x" * 33),
            (b"x" * 900, b"\0" * 33),
            (b"y", b"z" * 200),
        ]:
            session.put(key, payload, attachment=attachment)
            time.sleep(0.02)
            assert scans.poll() == []
        assert look(f"127.0.0.1:{port}", 0.1).nodes[0].name == "lira"
        assert node.boundary.counts
        del held


def test_its_router_may_start_later_and_start_anew_and_it_is_on_the_graph_again():
    port = free_port()
    with closing(RosNode("lira", connect=f"127.0.0.1:{port}")) as node:
        publisher = node.publisher(CMD_VEL)
        for _ in range(2):
            with closing(open_session("router", listen=port)) as router:
                came = []
                hears = router.declare_subscriber("0/cmd_vel/**", came.append)

                def heard(came=came):
                    publisher.put(Twist(0.1, 0.0), 0.0)
                    return came

                wait_for(heard, 10.0)
                tokens = [str(reply.ok.key_expr) for reply in router.liveliness().get("@ros2_lv/**")]
                assert len(tokens) == 2
                del hears


def test_names_and_addresses_that_cannot_be_are_refused():
    for words, match in [
        ({"connect": "nowhere"}, "no address"),
        ({"domain": 233}, "no domain"),
        ({"namespace": "a b"}, "no namespace"),
        ({"listen": "0.0.0.0:7447"}, "anybody who reaches"),
    ]:
        with pytest.raises(ConfigError, match=match):
            RosNode("lira", **words)
    with pytest.raises(ConfigError, match="no name for a node"):
        RosNode("a/b")


def test_where_no_router_is_that_is_said(monkeypatch, capsys):
    monkeypatch.setattr("lira.robot.ros2.robot.OPEN_S", 0.3)
    address = f"127.0.0.1:{free_port()}"
    with closing(RosNode("lira", connect=address)) as node:
        with pytest.raises(BusError, match="no router of rmw_zenoh answers") as refused:
            Ros2Robot(PROFILE, node, Interface(), RMW).open()
        assert "rmw_zenohd" in refused.value.remedy
    assert main(["ros2", "--rmw", "--connect", address]) == 2
    assert "cannot open a ROS 2 graph" in capsys.readouterr().err


@pytest.mark.parametrize("stamped", [False, True])
def test_the_verb_drives_it_and_finds_out_itself_what_it_wants(tmp_path, stamped):
    far_port, near_port = free_port(), free_port()
    name, near = f"verb_{near_port}", f"127.0.0.1:{near_port}"
    words = ["ros2", "--rmw", "--connect", f"127.0.0.1:{far_port}", "--domain", "5", "--name", name, "--listen", near]
    words += ["--profile", "thesis-sim", "--lidar-yaw", "180"]
    with closing(RmwPeer(far_port, domain=5, stamped=stamped)) as robot:
        with ChildProcess("the server", lira_command(*words), tmp_path / "ros2.log") as server:
            server.wait_ready("serves on", 30.0)
            policy = ["drive", "lidar-expert", "--name", name, "--connect", near]
            with ChildProcess("the policy", lira_command(*policy), tmp_path / "policy.log") as driver:
                driver.wait_ready("drives", 60.0)
                wait_for(lambda: robot.commands and any(robot.commands[-1][1][-48:]), 40.0)
            wait_for(lambda: not any(robot.commands[-1][1][-48:]), 2.0)
            assert server.stop() == 0
        assert "Traceback" not in server.output()
        assert robot.refused == []


def test_a_type_that_the_robot_does_not_want_is_refused_with_the_one_that_it_does(capsys):
    port = free_port()
    with closing(RmwPeer(port, stamped=True)):
        words = ["ros2", "--rmw", "--connect", f"127.0.0.1:{port}", "--listen", "127.0.0.1:1", "--cmd-vel", "twist"]
        assert main(words) == 2
    assert "Say --cmd-vel twist_stamped." in capsys.readouterr().err
