"""The layout for Foxglove that comes with the wheel: the robot in space, its camera, and who drives, why, over time."""

import json
from importlib import resources
from pathlib import Path
from typing import Any, cast

from lira.hal.errors import StorageError

FILE = "layouts/lira.json"


def layout_text() -> str:
    """Return the layout, as Foxglove imports it."""
    return (resources.files("lira.tools.view") / FILE).read_text(encoding="utf-8")


def save_layout(path: Path) -> None:
    """Write it to a file. Raises `StorageError`."""
    try:
        path.write_text(layout_text(), encoding="utf-8")
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another folder.") from error


def topics_and_paths(layout: Any) -> tuple[set[str], set[str]]:
    """Return which topics a layout shows, and which paths into messages it plots."""
    topics: set[str] = set()
    paths: set[str] = set()
    for panel in cast("dict[str, dict[str, Any]]", layout["configById"]).values():
        topics |= set(panel.get("topics", {}))
        image = panel.get("imageMode", {})
        topics |= {image[key] for key in ("imageTopic", "calibrationTopic") if key in image}
        topics |= {panel[key] for key in ("topicPath",) if key in panel}
        paths |= {line["value"] for line in panel.get("paths", [])}
        if "path" in panel:
            paths.add(panel["path"])
    return topics, paths


def load_layout() -> Any:
    """Return the layout as it is parsed."""
    return json.loads(layout_text())
