"""What is said of a robot by what it tells of its arena."""

import msgspec
import pytest

from lira.hal.errors import BusError
from lira.sim_backend.catalogue import load_world
from lira.tools.runs.remote.reach import world_in


def test_a_twin_tells_its_world_and_a_floor_none():
    world = load_world("line")
    assert world_in(msgspec.json.encode(world)) == world
    assert world_in(b"null") is None


@pytest.mark.parametrize("told", [b"{", b"[]", b'{"name": 1}'])
def test_a_world_that_is_not_understood_is_an_error_with_a_remedy(told):
    with pytest.raises(BusError, match="not understood") as refused:
        world_in(told)
    assert "one version" in refused.value.remedy
