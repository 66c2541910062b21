"""The verbs of `lira`, by what they are for: one table, and a module a verb.

A verb's module has `add_arguments(parser)` and `run(args) -> exit status`. Its docstring is the verb's help: first what
it does, then examples. Heavy imports belong inside `run`.
"""

from keyword import iskeyword
from typing import NamedTuple


class Verb(NamedTuple):
    """A line of `lira --help`."""

    module: str
    help: str


# Title of a group in the help, and its verbs; a group's folder is named beside its title.
GROUPS = {
    ("teach", "Teach"): {
        "demo": "teach a robot in the digital twin, from start to report, in minutes",
        "teach": "teach a robot yourself, from practice to a verdict",
        "study": "a study with people: orders, blocks, questions, table, analysis",
        "new": "begin an expert, a method, a robot, a sensor or a world of your own",
    },
    ("robots", "Robots"): {
        "twin": "the digital twin: a simulated ROSbot on the bus",
        "robot": "the physical ROSbot: opens its lidar, camera and base, and puts it on the bus",
        "ros2": "a robot that runs ROS 2: puts it on the bus through zenoh-bridge-ros2dds",
        "msgs": "write the ROS 2 package with our message types, for colcon build",
        "calibrate": "measure how far the base really goes, and write it into its settings",
        "parity": "the same motions on two robots, and where they differ",
    },
    ("learn", "Learn"): {
        "fusion": "the learner: reads sensors, decides, drives, trains, by any method",
        "drive": "let a novice or an expert drive, also on the robot itself",
        "train-expert": "train an expert of one sensor: camera, lidar or depth",
        "experiment": "repeat an experiment of the thesis, with statistics",
        "labels": "a log of labels: list, undo, explain, merge, look for damage and repair it",
    },
    ("screens", "Hand and eye"): {
        "joystick": "drive by hand: a gamepad on this machine, straight to the robot",
        "console": "watch the robot learn on a screen",
        "web": "watch, teach and drive the robot from a page in the browser",
        "view": "show the robot in Foxglove or Rerun, and its numbers to Prometheus; it only looks",
        "world": "draw a world from above and as the camera sees it",
    },
    ("records", "Records"): {
        "record": "record everything on a robot's bus, for later and for others' tools",
        "play": "a recording on the bus again, or as a robot that takes commands",
        "info": "what a recording holds",
        "explain": "why the robot did what it did: of a recording, or now",
        "rerun": "put a recorded run through its method again: the same, or what would have been otherwise",
        "export": "a recorded run as a data set: LeRobot, robomimic, CSV",
        "import": "a LeRobot data set or a bag as demonstrations, to start from",
        "report": "make the HTML page of a recorded run",
    },
    ("operation", "Operation"): {
        "up": "start all that a robot needs, and keep it running: twin, learner, page, pad",
        "status": "what is up: processes, rates, ages, link, who drives",
        "logs": "what the processes that are up have written",
        "down": "stop all that is up, drivers first and the robot last",
        "deploy": "run them from the start of the machine: systemd units, keys and rules, here or on the robot",
        "keys": "make the keys that say who may drive a robot, and encrypt the bus",
    },
    ("checks", "Checks"): {
        "doctor": "what is wrong with this machine and its devices, and the remedy",
        "stop-test": "break things while a robot drives, and measure how soon it stands",
        "bench": "measure speed on this machine",
    },
}


def module_of(folder: str, verb: str) -> str:
    """Return the full name of a verb's module."""
    name = f"{verb}_" if iskeyword(verb) else verb.replace("-", "_")
    return f"{__name__}.{folder}.{name}"


VERBS = {
    name: Verb(module_of(folder, name), help_) for (folder, _), verbs in GROUPS.items() for name, help_ in verbs.items()
}
