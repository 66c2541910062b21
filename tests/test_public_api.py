"""`import lira`: small, cheap, and the only name that is installed."""

import ast
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fresh import python

import lira

ROOT = Path(__file__).parent.parent
HEAVY = {"torch", "numpy", "cv2", "zenoh", "pybullet", "pygame", "msgspec", "rosbags"}


def test_importing_it_loads_nothing_heavy():
    done = python("import lira, sys; print(*sys.modules)")
    assert done.returncode == 0, done.stderr
    assert not HEAVY & set(done.stdout.split())


@pytest.mark.parametrize("name", ["Method", "Features", "MethodSettings", "load_profile", "LearnedPolicy"])
def test_what_a_plugin_is_written_with_takes_no_torch(name):
    done = python(f"import lira, sys; lira.{name}; print(*sys.modules)")
    assert done.returncode == 0, done.stderr
    assert not {"torch", "pybullet", "zenoh"} & set(done.stdout.split())


@pytest.mark.parametrize("name", lira.__all__)
def test_every_name_is_there_says_what_it_is_for_and_is_listed(name):
    assert getattr(lira, name).__doc__
    assert name in dir(lira)


def test_a_name_that_is_none_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'lira' has no attribute 'robots'"):
        _ = lira.robots


def test_type_checkers_see_the_names_that_are_there():
    tree = ast.parse(Path(lira.__file__).read_text())
    seen = next(node for node in tree.body if isinstance(node, ast.If))
    imported = {(node.module, each.name) for node in seen.body for each in node.names}
    assert imported == {(module, name) for module, names in lira._WHERE.items() for name in names}
    assert {name for _, name in imported} == set(lira.__all__)


@pytest.mark.slow
def test_the_wheel_installs_one_name_with_all_that_it_needs(tmp_path):
    build = "from setuptools.build_meta import build_wheel; import sys; print(build_wheel(sys.argv[1]))"
    # From a copy: what a build leaves behind is not for the clone.
    copy = tmp_path / "clone"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in listed.stdout.decode().split("\0"):
        path, target = ROOT / name, copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink():
            target.symlink_to(path.readlink())
        elif path.is_file():
            target.write_bytes(path.read_bytes())
    done = subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=copy, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    wheel = next(tmp_path.glob("*.whl"))
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"lira"}
    assert "lira/py.typed" in names
    # All that is no test and no document is there, data too.
    parts = ("hal", "robot", "sim_backend", "fusion", "tools")
    wanted = [name for name in listed.stdout.decode().split("\0") if name.split("/")[0] in parts]
    data = {".py", ".toml", ".msg", ".safetensors", ".css", ".tmpl"}
    missing = [name for name in wanted if Path(name).suffix in data and f"lira/{name}" not in names]
    assert not missing
