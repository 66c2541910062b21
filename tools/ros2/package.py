"""The ament package `lira_msgs`: our types for `colcon build`, from the .msg files that the bus itself uses. Pure."""

import re
from collections.abc import Mapping
from importlib import resources

from lira.hal.messages.ros.types import PACKAGE

_OTHERS = re.compile(r"^([a-z][a-z0-9_]*)/[A-Z]\w*(?:\[[^\]]*\])?\s", re.MULTILINE)
_MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>{version}</version>
  <description>What a robot of lira-rosbot says: what was applied and why, who decides what</description>
  <maintainer email="lira-rosbot@users.noreply.github.com">lira-rosbot</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>

{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
_BUILD = """\
cmake_minimum_required(VERSION 3.8)
project({name})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}
  DEPENDENCIES {depends}
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def definitions() -> dict[str, str]:
    """Our .msg files by their names."""
    folder = resources.files("lira.hal.messages") / "msg"
    found = [entry for entry in folder.iterdir() if entry.name.endswith(".msg")]
    return {entry.name: entry.read_text(encoding="utf-8") for entry in sorted(found, key=lambda entry: entry.name)}


def package_files(version: str) -> dict[str, str]:
    """Every file of the package by its path in it."""
    messages = definitions()
    depends = _depends(messages)
    names = [f"msg/{name}" for name in messages]
    manifest = _MANIFEST.format(
        name=PACKAGE, version=_release(version), depends="\n".join(f"  <depend>{each}</depend>" for each in depends)
    )
    build = _BUILD.format(
        name=PACKAGE,
        finds="".join(f"find_package({each} REQUIRED)\n" for each in depends),
        files="\n".join(f'  "{each}"' for each in names),
        depends=" ".join(depends),
    )
    return {"package.xml": manifest, "CMakeLists.txt": build, **dict(zip(names, messages.values(), strict=True))}


def _depends(messages: Mapping[str, str]) -> list[str]:
    """The packages whose types are used."""
    found = {name for text in messages.values() for name in _OTHERS.findall(text)}
    return sorted(found - {PACKAGE})


def _release(version: str) -> str:
    """The three numbers that ROS wants, without what Python says of a state between two releases."""
    match = re.match(r"(\d+)\.(\d+)(?:\.(\d+))?", version)
    return "0.0.0" if match is None else ".".join(part or "0" for part in match.groups())
