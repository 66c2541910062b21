"""Teach a robot by interaction, and bring your own experts, methods, robots and worlds.

This is the public API: the names of `__all__`. Within one major version they stay, and what they take and return stays
compatible; anything below `lira.hal`, `lira.robot`, `lira.fusion`, `lira.sim_backend` and `lira.tools` may change with
any version. Importing `lira` is cheap: what a name needs (PyTorch, pybullet) is loaded when the name is first used.

    import lira

    with lira.simulate("line") as robot:
        for step in lira.drive(robot, "camera-expert", steps=50):
            print(step.state.progress_m)

A robot: `simulate` opens a twin here, `connect` reaches a robot over the bus, `govern` opens one of your own class, and
`serve` puts it on the bus. All of them are a `Robot`. Learning: `drive` lets a policy or a method drive, `teach` has a
method taught on a twin. Yours: an `Expert` is a name and a function of `Features`; a `Method` has `propose`;
`MethodSettings` have `build`. Errors are `LiraError`s, which say what is wrong and what to do.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lira.fusion.control import Step
    from lira.fusion.experts.load import load_policy
    from lira.fusion.learning.learned_policy import LearnedPolicy
    from lira.fusion.log.label_log import read_demonstrations
    from lira.fusion.log.run_log import LapRecord, StepRecord, read_run
    from lira.fusion.methods.base import Choice, Expert, Method, Proposal
    from lira.fusion.methods.context import Context, MethodSettings
    from lira.fusion.preprocess import Features
    from lira.hal.client.connect import connect
    from lira.hal.errors import LiraError
    from lira.hal.messages import (
        Applied,
        Call,
        Command,
        Driver,
        Observation,
        Odometry,
        Phase,
        Range,
        Reason,
        Twist,
    )
    from lira.hal.port import Robot
    from lira.hal.profile import RobotProfile, load_profile
    from lira.hal.safety.governed import govern
    from lira.hal.server.serve import serve
    from lira.sim_backend.twin import Twin
    from lira.tools.runs.script import drive, teach
    from lira.tools.runs.simulated import simulate

_WHERE = {
    "lira.fusion.control": ("Step",),
    "lira.fusion.experts.load": ("load_policy",),
    "lira.fusion.learning.learned_policy": ("LearnedPolicy",),
    "lira.fusion.log.label_log": ("read_demonstrations",),
    "lira.fusion.log.run_log": ("LapRecord", "StepRecord", "read_run"),
    "lira.fusion.methods.base": ("Choice", "Expert", "Method", "Proposal"),
    "lira.fusion.methods.context": ("Context", "MethodSettings"),
    "lira.fusion.preprocess": ("Features",),
    "lira.hal.client.connect": ("connect",),
    "lira.hal.errors": ("LiraError",),
    "lira.hal.messages": (
        "Applied",
        "Call",
        "Command",
        "Driver",
        "Observation",
        "Odometry",
        "Phase",
        "Range",
        "Reason",
        "Twist",
    ),
    "lira.hal.port": ("Robot",),
    "lira.hal.profile": ("RobotProfile", "load_profile"),
    "lira.hal.safety.governed": ("govern",),
    "lira.hal.server.serve": ("serve",),
    "lira.sim_backend.twin": ("Twin",),
    "lira.tools.runs.script": ("drive", "teach"),
    "lira.tools.runs.simulated": ("simulate",),
}
_HOME = {name: module for module, names in _WHERE.items() for name in names}

__all__ = [
    "Applied",
    "Call",
    "Choice",
    "Command",
    "Context",
    "Driver",
    "Expert",
    "Features",
    "LapRecord",
    "LearnedPolicy",
    "LiraError",
    "Method",
    "MethodSettings",
    "Observation",
    "Odometry",
    "Phase",
    "Proposal",
    "Range",
    "Reason",
    "Robot",
    "RobotProfile",
    "Step",
    "StepRecord",
    "Twin",
    "Twist",
    "connect",
    "drive",
    "govern",
    "load_policy",
    "load_profile",
    "read_demonstrations",
    "read_run",
    "serve",
    "simulate",
    "teach",
]


def __getattr__(name: str) -> object:
    """Load a name of the public API when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module 'lira' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public API."""
    return sorted({*globals(), *__all__})
