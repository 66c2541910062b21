"""The layout for Foxglove that comes with the wheel: the robot in space, its camera, and who drives, why, over time."""

from importlib import resources
from pathlib import Path

from lira.hal.errors import StorageError

FILE = "layouts/lira.json"
NAMED = '"/rosbot/'  # in the file, where a robot of another name has its own


def layout_text(robot: str) -> str:
    """Return the layout for a robot, as Foxglove imports it. It fits a recording that is opened there, too."""
    text = (resources.files("lira.tools.view") / FILE).read_text(encoding="utf-8")
    return text.replace(NAMED, f'"/{robot}/')


def save_layout(path: Path, robot: str) -> None:
    """Write it to a file. Raises `StorageError`."""
    try:
        path.write_text(layout_text(robot), encoding="utf-8")
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another folder.") from error
