"""Objects by name, and whose fault it is."""

import re
import sys
from importlib.metadata import EntryPoint

import pytest

from lira.hal import plugins
from lira.hal.errors import ConfigError, PluginError
from lira.hal.plugins import Door, blame

DOOR = Door("gadget", "lira.gadgets", " or a .gadget file")
SHIPPED = {"first": 1, "second": 2}


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """Write modules into a folder that is worked in; what they leave behind in the interpreter goes again."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != ""])
    monkeypatch.setattr(plugins, "_owners", {})
    before = set(sys.modules)

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    yield write
    for name in set(sys.modules) - before:
        del sys.modules[name]


@pytest.fixture
def installed(monkeypatch):
    """Let a package be installed that offers gadgets."""

    def offer(**values):
        points = [EntryPoint(name, value, DOOR.group) for name, value in values.items()]
        monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points if group == DOOR.group else [])

    return offer


def test_what_comes_with_the_project_comes_first(installed):
    installed(first="elsewhere:thing")
    assert DOOR.find("first", SHIPPED) == 1


def test_an_installed_package_offers_its_own_by_name(lab, installed):
    lab("mylab_a/gadgets.py", "turbo = 7")
    installed(turbo="mylab_a.gadgets:turbo")
    assert DOOR.find("turbo", SHIPPED) == 7


def test_a_module_in_the_working_directory_is_found_by_its_name(lab):
    lab("mylab_b.py", "class Deep:\n    inner = 3\n")
    assert DOOR.find("mylab_b:Deep.inner", SHIPPED) == 3


def test_the_working_directory_hides_nothing_that_is_installed(lab):
    lab("msgspec.py", "x = 'mine'")
    with pytest.raises(ConfigError, match="msgspec has no 'x'"):
        DOOR.find("msgspec:x", SHIPPED)


def test_a_file_is_found_by_its_path_and_may_import_its_neighbour(lab, tmp_path):
    lab("deep/mylab_helper.py", "value = 5")
    path = lab("deep/thing.py", "from mylab_helper import value\nthing = object()")
    first = DOOR.find(f"{path}:thing", SHIPPED)
    assert DOOR.find("deep/thing.py:thing", SHIPPED) is first  # loaded once


@pytest.mark.parametrize("name", ["third", ":x", "x:", ""])
def test_an_unknown_name_lists_all_that_is_known(installed, name):
    installed(turbo="mylab:turbo")
    with pytest.raises(ConfigError, match=f"unknown gadget '{name}'") as refused:
        DOOR.find(name, SHIPPED)
    assert "first, second, turbo" in refused.value.remedy
    assert "MODULE:OBJECT or a .gadget file" in refused.value.remedy


@pytest.mark.parametrize("name", ["mylab_none:x", "mylab_none.deep:x", "none.py:x", "http://there:x"])
def test_a_module_that_is_not_there_is_no_fault_of_a_plugin(lab, tmp_path, name):
    with pytest.raises(ConfigError, match="there is no module") as refused:
        DOOR.find(name, SHIPPED)
    assert str(tmp_path) in refused.value.remedy


def test_an_object_that_is_not_there_is_told_with_those_that_are(lab):
    lab("mylab_c.py", "wall = 1\ndoor = 2\n")
    with pytest.raises(ConfigError, match=r"mylab_c has no 'wal'.*gadget 'mylab_c:wal'.*It has: wall, door"):
        DOOR.find("mylab_c:wal", SHIPPED)


@pytest.mark.parametrize(
    ("text", "what", "where"),
    [
        ("x = 1\ny = 1 / 0\n", "ZeroDivisionError: division by zero", r"line 2, in <module>: y = 1 / 0"),
        ("import mylab_missing\n", "ModuleNotFoundError: No module named 'mylab_missing'", "line 1, in <module>"),
        ("x = 1\ndef f(:\n", "SyntaxError", "line 2: def f"),
        ("raise ValueError('no lab')\n", "ValueError: no lab", "line 1"),
    ],
)
def test_a_fault_while_it_is_imported_is_the_plugins_with_its_line(lab, text, what, where):
    path = lab("mylab_d/broken.py", text)
    with pytest.raises(PluginError, match=f"gadget 'mylab_d.broken:x' failed: {what}") as failed:
        DOOR.find("mylab_d.broken:x", SHIPPED)
    assert str(path) in failed.value.remedy
    assert re.search(where, failed.value.remedy)


def test_a_fault_at_work_is_the_plugins_too_and_one_of_ours_is_not(lab):
    lab("mylab_e.py", "def act(x):\n    return helper(x)\n\ndef helper(x):\n    return 1 / x\n")
    act = DOOR.find("mylab_e:act", SHIPPED)
    with pytest.raises(ZeroDivisionError) as raised:
        act(0)
    blamed = blame(raised.value)
    assert isinstance(blamed, PluginError)
    assert "gadget 'mylab_e:act' failed: ZeroDivisionError" in blamed.what
    assert "line 5, in helper: return 1 / x" in blamed.remedy
    with pytest.raises(ZeroDivisionError) as ours:
        1 / 0  # noqa: B018
    assert blame(ours.value) is None


def test_of_two_plugins_in_a_package_the_one_that_fails_is_named(lab):
    lab("mylab_f/experts.py", "def act(): 1 / 0\n")
    lab("mylab_f/methods.py", "from mylab_f import helper\ndef build(): helper.help()\n")
    lab("mylab_f/helper.py", "def help(): [][0]\n")
    act, build = (DOOR.find(f"mylab_f.{name}", SHIPPED) for name in ("experts:act", "methods:build"))
    with pytest.raises(ZeroDivisionError) as raised:
        act()
    assert "the gadget 'mylab_f.experts:act' failed" in blame(raised.value).what
    with pytest.raises(IndexError) as raised:
        build()  # a neighbour of both
    assert "the gadget 'mylab_f.methods:build' failed" in blame(raised.value).what
    help_ = sys.modules["mylab_f.helper"].help
    with pytest.raises(IndexError) as raised:
        help_()  # by whom, nobody knows
    assert "'mylab_f.experts:act' or the gadget 'mylab_f.methods:build'" in blame(raised.value).what


def test_a_file_that_failed_may_be_mended_and_loaded_again(lab):
    path = lab("again.py", "x = 1 / 0")
    with pytest.raises(PluginError):
        DOOR.find("again.py:x", SHIPPED)
    path.write_text("x = 10_000_000\n")
    assert DOOR.find("again.py:x", SHIPPED) == 10_000_000


@pytest.mark.parametrize(("file", "module"), [("mylab_g/mylab_g.py", "mylab_g"), ("mylab_g/driver.py", "driver")])
def test_a_folder_that_is_no_module_is_said_to_be_one_with_the_file_in_it(lab, file, module):
    lab(file, "x = 1\n")
    with pytest.raises(ConfigError, match=r"'mylab_g' is a folder and no module") as refused:
        DOOR.find("mylab_g:x", SHIPPED)
    assert refused.value.remedy == f"Work in that folder, with {module}:x, or give {file}:x."
    assert DOOR.find(f"{file}:x", SHIPPED) == 1


def test_a_folder_in_a_package_is_no_module_either(lab):
    lab("mylab_h/__init__.py", "")
    lab("mylab_h/deep/thing.py", "x = 1\n")
    with pytest.raises(ConfigError, match=r"'mylab_h\.deep' is a folder.*mylab_h/deep/thing\.py:x"):
        DOOR.find("mylab_h.deep:x", SHIPPED)
    assert DOOR.find("mylab_h.deep.thing:x", SHIPPED) == 1


def test_a_module_in_which_nothing_is_has_nothing(lab):
    lab("mylab_i.py", "")
    with pytest.raises(ConfigError, match=r"It has: nothing\."):
        DOOR.find("mylab_i:x", SHIPPED)


def test_a_module_that_comes_from_no_file_has_what_it_has(lab):
    assert DOOR.find("sys:maxsize", SHIPPED) == sys.maxsize
