"""Which kind of test a file holds, by what it imports: nobody has to remember to mark one.

`unit`: pure, in milliseconds; `twin`: renders, looks ahead or trains; `processes`: starts processes, threads of a
server, a bus or a line, and mostly waits for them.
"""

import ast
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

SHARED = Path(__file__).parent
LONG = os.environ.get("LIRA_LONG") == "1"
TAKES_LONG = "takes many minutes in real time (make test-long)"
PROCESSES = (
    "lira.hal.bus.bus",
    "lira.hal.server",
    "lira.hal.client",
    "lira.robot.camera.device",
    "lira.robot.camera.sources.opening",
    "lira.robot.core2.device",
    "lira.robot.rosbot",
    "lira.robot.rplidar.device",
    "lira.robot.serial_port",
    "lira.robot.supervisor",
    *(f"lira.tools.bench.{name}" for name in ("drivers", "latency", "lockstep", "parts", "record", "takeover", "web")),
    "lira.tools.launch",
    "lira.tools.web.server",
    "lira.sim_backend.emulators.wire",
    "lira.fusion.learning.trainer.ProcessTrainer",
    "multiprocessing",
    "pty",
    "socket",
    "subprocess",
    "threading",
    "zenoh",
)
# They start what ends by itself, and as late as it likes: who uses them computes, or skips.
TELL_NOTHING = ("fresh.py", "foreign.py", "kinds.py")
TWIN = ("lira.sim_backend", "lira.fusion.learning", "lira.fusion.policies", "lira.tools", "pybullet", "torch")


@cache
def kind_of(path: Path) -> str:
    """Return "unit", "twin" or "processes" for a test file, with the helpers, beside it or shared, that it imports."""
    names = _imported(path)
    helpers = {folder / f"{name}.py" for folder in (path.parent, SHARED) for name in names if "." not in name}
    kinds = {kind_of(helper) for helper in helpers if helper.is_file() and helper.name not in TELL_NOTHING}
    if "processes" in kinds or _any_of(PROCESSES, names) or "e2e" in path.parts or "attack" in path.parts:
        return "processes"
    return "twin" if "twin" in kinds or "fresh" in names or _any_of(TWIN, names) else "unit"


def _imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def _statements(within: ast.AST) -> Iterator[ast.AST]:
    """Every statement, however deep; a walk would look at each name and number, too, which takes ten times as long."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        held = getattr(within, part, None)
        for node in held if isinstance(held, list) else ():
            yield node
            yield from _statements(node)


def _any_of(roots: tuple[str, ...], names: set[str]) -> bool:
    return any(name == root or name.startswith(f"{root}.") for name in names for root in roots)
