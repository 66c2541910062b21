"""The thesis's tasks: which experts go with which world, on which robot. Without torch."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Task:
    """Worlds whose novice learns from one pair of experts, and the robot of that experiment.

    `borrowed` names for an expert the task whose it is: the lidar expert of the garden drives in the corridor, too.
    So many fresh layouts in a row are a proof there: more of them where layouts differ in kind, not in place alone.
    """

    name: str
    profile: str
    worlds: tuple[str, ...]
    borrowed: dict[str, str] = field(default_factory=dict)
    proofs: int = 3

    def owner(self, expert: str) -> str:
        """Which task an expert was trained for."""
        return self.borrowed.get(expert, self.name)


DEFAULT = "line"
TASKS = {
    task.name: task
    for task in (
        Task(DEFAULT, "thesis-sim", ("line-obstacles", "race", "eight-obstacles")),
        Task("eight", "thesis-sim", ("eight",), {"lidar": DEFAULT}),
        Task("passage", "thesis-sim", ("passage", "passage-train")),
        Task("garden", "rosbot2", ("garden", "garden-train")),
        Task("corridor", "rosbot2", ("corridor", "corridor-train"), {"lidar": "garden"}, proofs=6),
        Task(
            "table-top",
            "thesis-sim-depth",
            ("table-top", "table-top-train"),
            {"camera": DEFAULT, "lidar": DEFAULT},
            proofs=6,
        ),
    )
}


def task_of(world: str) -> str:
    """Return the task that a world belongs to; a world of one's own is one with a line and boxes."""
    return next((name for name, task in TASKS.items() if world in task.worlds), DEFAULT)
