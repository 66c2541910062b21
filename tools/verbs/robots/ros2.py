"""Drive a robot that runs ROS 2, with nothing of ours on it: serve it here like any other.

On the robot: zenoh-bridge-ros2dds; or its ROS runs rmw_zenoh (--rmw), and then its router is all that is needed. Here:
this verb, and then lira fusion, lira joystick and lira console as always. The governor (limits, time-outs, emergency
stop, who may drive) works here. When this machine or the radio fails, only what the robot's own ROS stack does stops
it. robot/README.md says more.

examples:
  lira ros2 --look --connect rosbot:7447        what is there, on which keys, and the words for it
  lira ros2 --connect rosbot:7447 --image rosbot-jazzy
  lira ros2 --image list                        which images are known
  lira ros2 --rmw --connect rosbot:7447 --domain 3
  lira ros2 --offer --connect rosbot:7447       one of ours, offered to ROS (lira twin --ros2 starts this itself)
  lira ros2 --connect rosbot:7447 --namespace robot1 --topic odom=odometry/filtered --topic cmd_vel=base/cmd_vel
  lira drive lidar-expert

exit status: 0, --look: 1 if nothing came there; 2 if it cannot be reached or something else went wrong
"""

import argparse
import math
import sys
import threading
import time
from contextlib import closing
from typing import TYPE_CHECKING

from lira.hal.errors import BusError, ConfigError
from lira.tools.options import add_ros_domain, add_server

if TYPE_CHECKING:
    from lira.hal.bus.bus import Bus
    from lira.hal.ros_graph.look import Sight
    from lira.hal.ros_graph.node import RosNode
    from lira.robot.ros2.robot import Ros2Robot
    from lira.tools.ros2.wants import Wanted

PROFILE = "rosbot2"
LINK_S = 3.0
LISTEN_S = 3.0
NODE = "lira"
LOOK_S = 0.05
NOTHING_THERE = (
    "nothing of ours runs on this robot: if this machine, this program or the radio fails, only the robot's own "
    "controller stops it (look at its cmd_vel time-out, and try it with the wheels off the ground)"
)
NO_TIME = (
    "a Twist carries no time, so the robot cannot tell an old command: if its controller takes TwistStamped, "
    "say --cmd-vel twist_stamped"
)
ONE_LINK = (
    "there is one link to the robot: after a gap of the radio TCP delivers what queued up, and the robot may obey it "
    "late (robot/README.md says how the bridge listens for datagrams, too)"
)


MISSING = (
    "nothing comes on '{key}', so there is no {name}: name the topic with --topic {name}=ROS_TOPIC (--look lists them)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--connect", metavar="HOST:PORT", help="where the bridge listens, or rmw_zenoh's router")
    add(
        "--image",
        metavar="NAME",
        help="names, types, mounting and profile of a known ROS image, or of a .toml file; list: which there are",
    )
    add("--look", action="store_true", help="only list what comes there, and print the words that drive it")
    add(
        "--offer",
        nargs="?",
        const="",
        metavar="HOST:PORT",
        help="the other way round: offer the robot of ours at --connect to the graph of rmw_zenoh whose router is "
        "there (without an address, or with own:HOST:PORT: be the router)",
    )
    add("--rmw", action="store_true", help="its ROS runs rmw_zenoh, and no bridge is needed")
    add_ros_domain(parser, "with --rmw: the robot's ROS_DOMAIN_ID")
    add("--namespace", default="", help="namespace that the names of its topics begin with (default: none)")
    add(
        "--cmd-vel",
        choices=("twist", "twist_stamped"),
        help="type of the robot's cmd_vel; newer controllers want TwistStamped (default: what it says that it hears)",
    )
    add(
        "--topic",
        action="append",
        default=[],
        metavar="NAME=ROS_TOPIC",
        help="another topic for scan, camera, odom, imu, battery or cmd_vel; may be given several times",
    )
    add("--lidar-yaw", type=float, metavar="DEG", help="how the lidar's frame is turned (default: the image's, or 0)")
    add("--profile", help=f"robot by name or .toml file (default: the image's, or {PROFILE})")
    add_server(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until told to stop, or say what there is."""
    from lira.robot.ros2.image import known_images, load_image

    if args.image == "list":
        print("\n".join(f"{name:<20}{description}" for name, description in known_images().items()))
        return 0
    if args.connect is None:
        raise ConfigError("no --connect", "Give HOST:PORT of the bridge on the robot, or of rmw_zenoh's router.")
    if args.look:
        from lira.hal.ros_graph.look import look
        from lira.tools.ros2.page import page

        sight = look(args.connect, LISTEN_S)
        print("\n".join(page(sight, args.connect)))
        return 0 if sight.heard else 1

    if args.offer is not None:
        return run_offer(args)

    from lira.hal.bus.bus import Bus
    from lira.hal.profile import load_profile
    from lira.hal.server.serve import serve
    from lira.robot.ros2.robot import Interface, Ros2Robot
    from lira.robot.ros2.transport import BRIDGE, RMW
    from lira.tools.launch.notify import Notifier
    from lira.tools.output.troubles import watch
    from lira.tools.ros2.wants import Place, commanded, published

    notifier = Notifier.from_environment()
    image = None if args.image is None else load_image(args.image)
    named = topics(args.topic)
    Interface(named)
    profile = load_profile(args.profile or (PROFILE if image is None else image.profile))
    sight, place = seen(args), Place(args.domain if args.rmw else None, args.namespace)
    names = named if image is None else image.choose(published(sight, place)) | named
    wanted = commanded(sight, place, names.get("cmd_vel", "cmd_vel"), args.cmd_vel, image)
    yaw_deg = args.lidar_yaw if args.lidar_yaw is not None else 0.0 if image is None else image.lidar_yaw_deg
    interface = Interface(names, wanted.stamped, math.radians(yaw_deg), "" if image is None else image.manual)
    with closing(open_far(args, wanted)) as far:
        robot = Ros2Robot(profile, far, interface, RMW if args.rmw else BRIDGE)

        def ready(_: Bus, stop: threading.Event) -> None:
            words = f"robot '{args.name}' (ROS 2 at {args.connect}) serves on {args.listen}"
            print(words, flush=True)
            notifier.ready(words)
            told = () if image is None else image.told
            for warning in [*warnings(far, stamped=interface.stamped), *lacking(robot), *told]:
                print(f"warning: {warning}", file=sys.stderr, flush=True)
            watch(robot, stop)

        serve(robot, args.name, args.listen, insecure=args.insecure, ready=ready, alive=notifier.alive)
    return 0


def run_offer(args: argparse.Namespace) -> int:
    """Offer a robot of ours to ROS until told to stop."""
    from lira.hal.signals import stop_on_signal
    from lira.tools.ros2.graph import graph_of
    from lira.tools.ros2.offer import offer

    graph = graph_of(args.offer, args.domain, args.namespace, insecure=args.insecure)

    def ready() -> None:
        first, *rest = graph.told()
        print("\n".join([f"robot '{args.name}' is {first}", *rest]), flush=True)

    with stop_on_signal() as stop:
        offer(args.name, args.connect, graph, stop, ready)
    return 0


def seen(args: argparse.Namespace) -> "Sight":
    """Look what its own nodes say and hear. A bridge that is not there yet, or lets no token through, shows nothing."""
    from lira.hal.ros_graph.look import Sight, look

    try:
        return look(args.connect)
    except BusError:
        if args.rmw:
            raise
        return Sight()


def open_far(args: argparse.Namespace, wanted: "Wanted") -> "Bus | RosNode":
    """Open what carries the robot's topics."""
    from lira.hal.bus.bus import Bus
    from lira.hal.ros_graph.node import RosNode

    if not args.rmw:
        return Bus(args.name, connect=args.connect, prefix=args.namespace.strip("/"))
    return RosNode(NODE, connect=args.connect, domain=args.domain, namespace=args.namespace, hashes=wanted.hashes)


def topics(words: list[str]) -> dict[str, str]:
    """Read NAME=ROS_TOPIC. Raises `ConfigError`."""
    found = {}
    for word in words:
        name, equals, topic = word.partition("=")
        if not equals or not topic.strip("/"):
            raise ConfigError(f"--topic {word} names no topic", "Write for example --topic odom=odometry/filtered.")
        found[name] = topic
    return found


def warnings(far: "Bus | RosNode", *, stamped: bool) -> list[str]:
    """What is missing beside a robot that runs our server."""
    from lira.hal.bus.bus import LINKS_PER_PEER

    until_s = time.monotonic() + LINK_S
    while far.links() < LINKS_PER_PEER and time.monotonic() < until_s:
        time.sleep(LOOK_S)
    found = [NOTHING_THERE]
    if not stamped:
        found.append(NO_TIME)
    if far.links() < LINKS_PER_PEER:
        found.append(ONE_LINK)
    return found


def lacking(robot: "Ros2Robot") -> list[str]:
    """What never came of what is of use, after what `warnings` waited for."""
    return [MISSING.format(name=name, key=key) for name, key in robot.missing().items()]
