"""Where a verb writes, if nobody says where."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from lira.hal.errors import StorageError
from lira.tools.output.places import own_folder


def test_who_begins_in_the_same_second_gets_a_folder_of_its_own(tmp_path):
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(lambda _: own_folder(tmp_path / "runs", "demo-"), range(8)))
    assert len(set(folders)) == 8
    assert all(folder.is_dir() and folder.name.startswith("demo-20") for folder in folders)


def test_where_no_folder_can_be_is_said_with_its_remedy(tmp_path):
    (tmp_path / "runs").write_text("a file")
    with pytest.raises(StorageError, match=r"can be no folder.*Choose another folder"):
        own_folder(tmp_path / "runs")
