"""One robot of a name on a machine."""

import stat
import subprocess
import sys
import tempfile

import pytest
from wiring import new_name

from lira.hal.errors import BusError
from lira.hal.server.instance import only_instance

HOLDER = """
import sys, time
from lira.hal.server.instance import only_instance
with only_instance(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_name_is_held_once_and_let_go_even_by_a_killed_process():
    name = new_name()
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, name], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(BusError, match=f"'{name}' already runs"), only_instance(name):
            pass
        with only_instance(new_name()):
            pass
    finally:
        holder.kill()
        holder.wait()
        holder.stdout.close()
    with only_instance(name):
        pass


def test_what_stands_for_a_name_is_the_user_s_own_and_goes_with_it(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    name = new_name()
    with only_instance(name):
        (lock,) = tmp_path.rglob("*.lock")
        assert stat.S_IMODE(lock.parent.stat().st_mode) == 0o700
        with pytest.raises(BusError, match="already runs"), only_instance(name):
            pass
    assert list(tmp_path.rglob("*.lock")) == []
    lock.parent.chmod(0o777)
    with pytest.raises(BusError, match="others may write"), only_instance(name):
        pass


def test_a_folder_that_takes_no_file_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(BusError, match="TMPDIR"), only_instance(new_name()):
        pass
