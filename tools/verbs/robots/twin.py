"""Run the digital twin: a simulated ROSbot on the bus, driven exactly like the real one.

It publishes the sensors and obeys velocity commands below its name (rosbot/scan, rosbot/cmd_vel, ...). Start a driver
in another shell, for example `lira drive camera-expert`. Without one the robot stands.

examples:
  lira twin                                   the line world in real time, for anyone on this machine
  lira twin --world race --layout 7           another world, another layout of its boxes
  lira twin --world my-track.toml             a world of your own: copy one of sim_backend/worlds
  lira twin --profile rosbot2 --speed 1.5     the ROSbot 2.0's sensors and wheels, 1.5 times real time
  lira twin --wire /tmp/wire --profile rosbot2  its devices, in the real ones' protocols, for `lira robot` to open
  lira twin --ros2                            offered to ROS 2 (rmw_zenoh), too: topics, transforms, commands
  lira twin --lockstep                        time stands until the driver has answered: fast and repeatable
"""

import argparse
import shlex
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.options import add_layout, add_profile, add_randomise, add_seed, add_server, add_world
from lira.tools.ros2.graph import add_graph, offered

if TYPE_CHECKING:
    from lira.hal.bus.bus import Bus
    from lira.hal.profile import RobotProfile
    from lira.sim_backend.emulators.wired_twin import WiredTwin
    from lira.sim_backend.twin import Twin
    from lira.sim_backend.world import World

LOOK_S = 0.2
STATUS_S = 10.0
DRAWN = {"sketch": "sketched", "tiny": "drawn by pybullet", "egl": "drawn by pybullet with OpenGL"}
LIDAR = "a2m8-1.29"
ECHOES = 0.5  # of the directions ahead: with less the learner refuses the scan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add_world(parser, "line")
    add_profile(parser, "thesis-sim")
    add_server(parser)
    add_graph(parser)
    add_layout(parser, "which random layout of the world's boxes")
    add_randomise(parser)
    add_seed(parser, "seeds the sensors' noise")
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument("--speed", type=float, default=1.0, metavar="X", help="times real time (default: %(default)g)")
    pace.add_argument("--lockstep", action="store_true", help="time passes only when the driver has answered")
    pace.add_argument(
        "--wire",
        type=Path,
        metavar="DIR",
        help="be its devices, not a robot on the bus: lidar and base as serial ports in DIR, and a network camera",
    )
    add(
        "--lidar",
        metavar="UNIT",
        help="with --wire: which RPLIDAR: a2m8-1.20 or a2m8-1.29 (by its firmware), a2m7, a2m12, a1, a3 "
        f"(default: {LIDAR})",
    )
    add(
        "--arena",
        metavar="HOST:PORT",
        help="with --wire: where a scripted teacher asks where the robot really is, and has it put back",
    )
    add(
        "--renderer",
        choices=("auto", "sketch", "tiny", "egl"),
        default="auto",
        help="what draws and measures the world: sketch runs anywhere, tiny and egl are pybullet's; auto is pybullet "
        "where it is installed (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Serve until told to stop."""
    from msgspec.structs import replace

    from lira.hal.profile import load_profile
    from lira.sim_backend.catalogue import load_world

    # What is wrong with the words is said at once, before anything heavy is loaded.
    profile, world = load_profile(args.profile), load_world(args.world)
    if args.randomise:
        world = replace(world, randomised=True)

    if args.arena is not None and args.wire is None:
        raise ConfigError("--arena goes with --wire", "A twin that is a robot on the bus tells the truth there.")
    if args.lidar is not None and args.wire is None:
        raise ConfigError("--lidar goes with --wire", "A twin that is a robot on the bus has its profile's lidar.")
    if args.ros2 is not None and (args.lockstep or args.wire is not None):
        raise ConfigError("--ros2 is for a robot on the bus in real time", "Leave out --lockstep or --wire.")
    if args.wire is not None:
        return run_wire(args, profile, world)

    from lira.hal.server.serve import serve
    from lira.sim_backend.twin import Twin
    from lira.tools.launch.notify import Notifier

    notifier = Notifier.from_environment()
    factor = None if args.lockstep else args.speed
    twin = Twin(profile, world, layout=args.layout, seed=args.seed, realtime_factor=factor, renderer=args.renderer)
    pace = "lockstep" if args.lockstep else "real time" if factor == 1.0 else f"{factor:g} times real time"

    def ready(bus: "Bus", stop: threading.Event) -> None:
        where = f"world '{world.name}' ({profile.name}, {DRAWN[twin.renderer]}) on {args.listen}"
        where += ", encrypted" if bus.encrypted else ", open to anybody there" if args.insecure else ""
        words = f"twin '{args.name}' serves {where}, {pace}"
        print(f"{words}; stop with Ctrl-C", flush=True)
        notifier.ready(words)
        if not args.lockstep:  # there the driver tells how it goes
            threading.Thread(target=report, args=(twin, bus, stop), daemon=True, name="status").start()

    with offered(args):
        serve(
            twin,
            args.name,
            args.listen,
            arena=twin,
            arena_info=twin.info,
            lockstep=args.lockstep,
            insecure=args.insecure,
            ready=ready,
            alive=notifier.alive,
        )
    return 0


def run_wire(args: argparse.Namespace, profile: "RobotProfile", world: "World") -> int:
    """Be the robot's devices until told to stop."""
    from lira.hal.bus.bus import Bus
    from lira.hal.signals import stop_on_signal
    from lira.sim_backend.emulators.rplidar_models import MODELS
    from lira.sim_backend.emulators.wired_twin import WiredTwin, sweeping
    from lira.sim_backend.twin import Twin

    model = MODELS.get(args.lidar or LIDAR)
    if model is None:
        raise ConfigError(f"there is no lidar '{args.lidar}'", f"Known units: {', '.join(MODELS)}.")
    sweep = sweeping(profile)
    twin = Twin(sweep, world, layout=args.layout, seed=args.seed, realtime_factor=1.0, renderer=args.renderer)
    with stop_on_signal() as stop, ExitStack() as held:
        bus = None
        if args.arena is not None:
            bus = Bus(args.name, listen=args.arena, insecure=args.insecure)
            held.callback(bus.close)
        wired = WiredTwin(twin, args.wire, model)
        try:
            _check_echoes(wired.echo_share(), profile, world)
            urls = ["--lidar", f"{args.wire}/rplidar", "--base", f"{args.wire}/core2", "--camera", wired.url]
            urls += ["--profile", args.profile]
            print(f"world '{world.name}' behind its devices; open them with: lira robot {shlex.join(urls)}", flush=True)
            if bus is None:
                stop.wait()
            else:
                serve_arena(wired, bus, profile, stop)
        finally:
            wired.close()
    return 0


def _check_echoes(share: float, profile: "RobotProfile", world: "World") -> None:
    """Refuse a world in which the real robot's lidar would be as good as blind, so that nothing drives it."""
    if share < ECHOES:
        raise ConfigError(
            f"in world '{world.name}' the lidar of '{profile.name}' gets an echo from {share:.0%} of the way ahead, "
            "and its real driver cannot tell open ground from a blind lidar",
            f"Choose a world with walls within {profile.lidar.range_max_m:g} m, such as room or corridor, or leave out "
            "--wire.",
        )


def serve_arena(wired: "WiredTwin", bus: "Bus", profile: "RobotProfile", stop: threading.Event) -> None:
    """Tell the truth, and put the robot back when asked, until told to stop."""
    import msgspec

    from lira.hal.bus.services import REALTIME, Info
    from lira.hal.server.arena import ArenaLoop

    info = Info(profile, REALTIME, bus.epoch, msgspec.Raw(wired.twin.info))
    ArenaLoop(wired, bus, info, wired.twin.now).run(stop)


def report(twin: "Twin", bus: "Bus", stop: threading.Event) -> None:
    """Say now and then who drives, how fast, and what was hit; nothing while nothing changes."""
    from lira.hal.bus.topics import APPLIED

    applied, said, hit, collisions = bus.reader(APPLIED), "", False, 0
    next_s = time.monotonic()
    while not stop.wait(LOOK_S):
        state = twin.state()
        collisions += state.collided and not hit
        hit = state.collided
        if time.monotonic() < next_s:
            continue
        newest = applied.newest()
        driver = newest.message.source if newest is not None else "none"
        words = f"{'nobody' if driver == 'none' else driver} drives"
        words += f", {state.linear_m_s:.1f} m/s, collisions {collisions}"
        if words != said:
            print(words, flush=True)
            next_s = time.monotonic() + STATUS_S
        said = words
