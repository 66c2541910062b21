"""`lira msgs` writes a package that ROS builds, and every side knows its types by the same hashes."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from foreign import ros_share, run_ros

from lira.hal.messages.ros.types import PACKAGE, TYPES
from lira.hal.rmw.hashes import type_hash
from lira.tools.cli import main
from lira.tools.ros2.package import definitions, package_files

ROOT = Path(__file__).parents[3]
OURS = [f"{PACKAGE}/msg/{name.removesuffix('.msg')}" for name in definitions()]


@pytest.fixture
def package(tmp_path, capsys):
    assert main(["msgs", str(tmp_path)]) == 0
    assert "colcon build --packages-select lira_msgs" in capsys.readouterr().out
    return tmp_path / PACKAGE


def test_the_ros2_package_has_all_our_types_and_names_what_they_need(package):
    manifest = ET.fromstring((package / "package.xml").read_text())
    assert (manifest.get("format"), manifest.findtext("name")) == ("3", PACKAGE)
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest.findtext("version"))
    assert manifest.findtext("member_of_group") == "rosidl_interface_packages"
    build = (package / "CMakeLists.txt").read_text()
    needed = {each.text for each in manifest.findall("depend")}
    for name, text in definitions().items():
        assert (package / "msg" / name).read_text() == text
        assert f'"msg/{name}"' in build
        used = {ros_type.partition("/")[0] for ros_type in re.findall(r"^(\w+/\w+)", text, re.MULTILINE)}
        assert used - {PACKAGE} <= needed
    assert all(f"find_package({each} REQUIRED)" in build for each in needed)


def test_a_ros2_package_is_written_anew_and_nothing_else_is_overwritten(package, capsys):
    (package / "msg" / "Applied.msg").write_text("old")
    assert main(["msgs", str(package.parent)]) == 0
    assert (package / "msg" / "Applied.msg").read_text() == definitions()["Applied.msg"]
    other = package.parent / "other" / PACKAGE
    other.mkdir(parents=True)
    assert main(["msgs", str(other.parent)]) == 2
    assert "is no ROS package" in capsys.readouterr().err


def test_a_version_between_releases_is_one_that_ros2_takes():
    for version, told in (("1.2.3.dev4+g1", "1.2.3"), ("0.1", "0.1.0"), ("x", "0.0.0")):
        assert f"<version>{told}</version>" in package_files(version)["package.xml"]


@pytest.mark.parametrize("ros_type", OURS)
def test_the_documents_name_the_hash_that_rosbags_computes_for_ros2(ros_type):
    told = TYPES.hash_rihs01(ros_type)
    assert told == type_hash(ros_type)
    assert f"| `{ros_type}` | `{told.removeprefix('RIHS01_')}` |" in (ROOT / "docs" / "bus.md").read_text()


def test_the_generator_of_ros2_takes_our_types_and_hashes_them_as_we_do(package):
    script = Path(__file__).parent / "rosidl_hashes.py"
    written = run_ros(script, str(package), str(ros_share()))
    told = json.loads(written.splitlines()[-1])
    assert {name for name in told if name.startswith(PACKAGE)} == set(OURS)
    for name, found in told.items():
        assert found == type_hash(name), name
