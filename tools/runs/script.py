"""What a script or a notebook calls: let something drive a robot, or have it taught on a twin."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from lira.fusion.control import ControlLoop, Step
from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import DEFAULT
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.methods.base import Expert, Method, Policy
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.presets import OwnSettings, Preset, method_named
from lira.fusion.methods.shield import Shield, Shielded
from lira.hal.bus.services import understood
from lira.hal.client.remote import RemoteRobot
from lira.hal.errors import ConfigError
from lira.hal.messages import STOP, Command
from lira.hal.port import Robot
from lira.hal.safety.governed import GovernedRobot
from lira.sim_backend.world import World
from lira.tools.runs.plan import Plan
from lira.tools.runs.simulated import SimulatedRobot
from lira.tools.runs.teach import Taught, teach_on


def drive(
    robot: Robot,
    policy: str | Policy | Expert | Method,
    *,
    steps: int | None = None,
    experts: str = DEFAULT,
    shield: bool = False,
) -> Iterator[Step]:
    """Let a policy or a method drive an open robot, and yield each decision; a human may take over at any time.

    `policy` is a name, a function of `Features`, an `Expert` or a `Method`, which goes on learning. It ends after so
    many decisions, or when you stop asking for more; then the robot stands. A decision for which a sensor was missing
    is not yielded. With `shield` a turn that would touch what the lidar sees gives way to one that does not. Raises
    `ConfigError` for a robot without a governor: open it with `simulate`, `govern` or `connect`.
    """
    if not isinstance(robot, GovernedRobot | RemoteRobot):
        what = f"a {type(robot).__name__} has no governor that would stop it"
        raise ConfigError(what, "Open it with lira.govern, or reach it over the bus with lira.connect.")
    if not isinstance(policy, Method):
        policy = load_alone(policy, robot.profile, experts)
    if shield:
        policy = Shielded(policy, Shield(robot.profile))
    return _steps(robot, policy, steps)


def _steps(robot: GovernedRobot | RemoteRobot, method: Method, steps: int | None) -> Iterator[Step]:
    arena = robot.arena if isinstance(robot, RemoteRobot | SimulatedRobot) else None
    loop = ControlLoop(robot, truth=None if arena is None else arena.state)
    loop.arm()
    taken = 0
    try:
        while steps is None or taken < steps:
            taken += 1
            step = loop.step(method)
            if step is not None:
                yield step
    finally:
        robot.drive(Command(STOP, robot.now(), answers=robot.read().seq))


def teach(
    robot: SimulatedRobot | RemoteRobot,
    method: str | Preset | MethodSettings | Callable[[Context], Method] = "lira",
    *,
    more_experts: Sequence[str | Expert | Policy] = (),
    experts: str | None = None,
    teacher: str = "scripted",
    layout: int = 0,
    laps: int = 12,
    unseen: int = 3,
    seed: int = 0,
    folder: Path | str | None = None,
    say: Callable[[str], None] = print,
) -> Taught:
    """Have a method taught on a twin by a scripted teacher, until its novice drives the lap alone.

    `method` is a name as in `lira fusion --method`, settings of yours, or what makes a `Method` of a `Context`, such as
    a subclass of `Method`. `experts` says whose pair takes part (that of the task), `more_experts` adds your
    own. Then the novice drives `unseen` layouts alone. `folder` keeps labels, record and novice. `say` gets a line for
    each lap. Raises `ConfigError`, for a robot that is no twin too, and `PluginError`.
    """
    one_thread()  # a result should not depend on the number of cores
    arena = robot.arena
    if arena is None:
        raise ConfigError("only a twin has laps to teach on", "With a person as teacher: lira fusion --method.")
    build = None
    if isinstance(method, str):
        preset = method_named(method)
    elif isinstance(method, Preset):
        preset = method
    else:
        name = str(getattr(method, "__name__", type(method).__name__))
        preset = Preset(name, OwnSettings(name=name))
        build = method.build if isinstance(method, MethodSettings) else method
    where = Path(folder) if folder is not None else None
    plan = Plan(
        preset, layout, seed, laps, unseen, teacher, experts, more_experts, build, where, command="lira.teach(...)"
    )
    world: World = understood(World, arena.info)
    trainer = partial(InlineTrainer, adopt_after_s=robot.profile.period_s)  # weights drive when they would on a robot
    return teach_on(robot, arena, world, plan, trainer, say)
