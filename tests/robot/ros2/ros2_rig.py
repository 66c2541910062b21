"""A peer that runs ROS 2, our server for it in a thread, and a client of that; and what the tests do with them."""

import threading
import time
from contextlib import closing, contextmanager

from rmw_peer import RmwPeer
from ros2_peer import Peer

from lira.hal.bus.bus import Bus
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.profile import load_profile
from lira.hal.ros_graph.node import RosNode
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.robot.ros2.transport import BRIDGE, RMW
from lira.tools.launch.processes import free_port

PROFILE = load_profile("thesis-sim")
GO = Twist(0.3, 0.5)


@contextmanager
def served(interface=Interface(), namespace="", *, rmw=False, hashes=None, **peer):  # noqa: B008 - frozen
    """A peer, our server for it in a thread, and a client of that."""
    far_port, near_port = free_port(), free_port()
    robot = (RmwPeer if rmw else Peer)(far_port, namespace, **peer)
    name, endpoint, stop = f"ros_{near_port}", f"127.0.0.1:{near_port}", threading.Event()
    address = f"127.0.0.1:{far_port}"
    if rmw:
        far = RosNode("lira", connect=address, domain=peer.get("domain", 0), namespace=namespace, hashes=hashes)
    else:
        far = Bus(name, connect=address, prefix=namespace)
    near = Bus(name, listen=endpoint)
    governed = GovernedRobot(Ros2Robot(PROFILE, far, interface, RMW if rmw else BRIDGE))
    server = threading.Thread(target=HalServer(governed, near).run, args=(stop,))
    server.start()
    bus = Bus(name, connect=endpoint)
    try:
        with closing(open_remote(bus, answer_s=10.0)) as client:
            yield robot, client
    finally:
        stop.set()
        server.join(10.0)
        for each in (bus, near, far):
            assert each.close()
        robot.close()


def drive_until(client, twist, wanted, timeout_s=5.0):
    until_s = time.monotonic() + timeout_s
    while not wanted(applied := client.drive(Command(twist, client.now()))):
        assert time.monotonic() < until_s, applied
        time.sleep(0.005)
    return applied


def get_going(client):
    drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
    drive_until(client, GO, lambda applied: applied.twist == GO)


def wait_for(condition, timeout_s=5.0):
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.01)
