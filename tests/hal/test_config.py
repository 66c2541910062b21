"""Files that somebody else wrote: bounded where they enter, and one clear error for what is none."""

import os
from pathlib import Path

import pytest

from lira.hal.config import MOST_BYTES, Table, load_json, load_toml, read_bounded, write_whole
from lira.hal.errors import ConfigError, StorageError


class Small(Table, frozen=True):
    """A table for tests."""

    value: float


def pipe(path):
    os.mkfifo(path)


def zeros(path):
    path.symlink_to("/dev/zero")


def huge(path):
    with path.open("wb") as file:
        file.truncate(2**30)


def nested(path):
    path.write_text("value = " + "[" * 50_000)


def nested_json(path):
    path.write_text("[" * 50_000)


def not_text(path):
    path.write_bytes(b"value = \xff\xfe")


def long_number(path):
    path.write_text(f"value = {'9' * 5000}")


def large_number(path):
    path.write_text(f"value = {'9' * 400}")


def dotted(path):
    path.write_text(".".join(["a"] * 30_000) + " = 1")


def inline(path):
    path.write_text("value = " + "{a = " * 20_000)


@pytest.mark.parametrize("load", [load_toml, load_json])
@pytest.mark.parametrize(
    "make",
    [pipe, zeros, huge, nested, nested_json, not_text, long_number, large_number, dotted, inline],
    ids=lambda make: make.__name__,
)
def test_a_file_that_is_none_is_one_clear_error(tmp_path, load, make):
    make(tmp_path / "file")
    with pytest.raises(ConfigError) as refused:
        load(tmp_path / "file", Small)
    assert str(tmp_path / "file") in refused.value.what
    assert refused.value.remedy
    assert len(refused.value.what) < 1000


def test_a_missing_file_and_a_folder(tmp_path):
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(ConfigError, match="cannot read"):
            read_bounded(path)


def test_a_file_at_the_bound_is_read(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * MOST_BYTES)
    assert len(read_bounded(path)) == MOST_BYTES
    path.write_bytes(b"x" * (MOST_BYTES + 1))
    with pytest.raises(ConfigError, match="more than"):
        read_bounded(path)


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path, link = tmp_path / "new" / "file", tmp_path / "link"
    with pytest.raises(StorageError, match="No such file"):
        write_whole(path, b"first")  # a slip of the pen makes no folder
    write_whole(path, b"first", folder=True)
    link.symlink_to(path)
    write_whole(link, b"second")
    assert link.is_symlink()
    assert path.read_bytes() == b"second"

    def full(_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("lira.hal.config.os.fsync", full)
        with pytest.raises(StorageError, match="No space left"):
            write_whole(path, b"third")
    assert path.read_bytes() == b"second"
    assert [entry.name for entry in path.parent.iterdir()] == ["file"]


def test_a_device_is_written_to_and_stays(tmp_path):
    link = tmp_path / "full"
    link.symlink_to("/dev/full")
    with pytest.raises(StorageError, match="No space left"):
        write_whole(link, b"x")
    assert Path("/dev/full").is_char_device()
