"""The thesis's tasks: which experts go with which world, on which robot. Without torch."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Task:
    """Worlds whose novice learns from one pair of experts, and the robot of that experiment.

    `lidar` names the task whose lidar expert is used: the one of the garden drives in the corridor too (F.1).
    """

    profile: str
    worlds: tuple[str, ...]
    lidar: str


DEFAULT = "line"
TASKS = {
    DEFAULT: Task("thesis-sim", ("line-obstacles", "race", "eight-obstacles"), lidar=DEFAULT),
    "eight": Task("thesis-sim", ("eight",), lidar=DEFAULT),
    "passage": Task("thesis-sim", ("passage", "passage-train"), lidar="passage"),
    "garden": Task("rosbot2", ("garden", "garden-train"), lidar="garden"),
    "corridor": Task("rosbot2", ("corridor", "corridor-train"), lidar="garden"),
}


def task_of(world: str) -> str:
    """Return the task that a world belongs to; a world of one's own is one with a line and boxes."""
    return next((name for name, task in TASKS.items() if world in task.worlds), DEFAULT)
