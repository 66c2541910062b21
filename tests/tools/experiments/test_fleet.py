"""Laps that are driven abreast in twins of their own: the same as one after the other, and repeatable to the bit."""

import pytest

from lira.fusion.experts.load import load_policy
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, StepRecord
from lira.fusion.methods.base import Alone
from lira.fusion.teaching.ride import Drive
from lira.hal.messages import Episode, Phase
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.tools.experiments.fleet import fleet

PROFILE, WORLD = load_profile("thesis-sim"), load_world("line-obstacles")
DRIVES = [Drive(Episode(layout, start_m=4.0), 6.0) for layout in (3, 4, 5)]


class Asked:
    """The lidar's expert, and with how many observations at once it was asked."""

    def __init__(self, *, together):
        self.counts = []
        self.act = load_policy("lidar-expert", PROFILE).act
        self.method = Alone("lidar", self.act, self.all if together else None)

    def all(self, seen):
        self.counts.append(len(seen))
        return [self.act(each) for each in seen]


def laps(asked, phase=Phase.UNSEEN):
    """What came of the laps, and what was written down of each."""
    written = [[] for _ in DRIVES]
    with fleet(WORLD, PROFILE, 3) as robots:
        records = robots.drive(asked.method, DRIVES, phase, 2, [Journal(write=each.append) for each in written])
    return records, [[step.state for step in each if isinstance(step, StepRecord)] for each in written]


def what_came(record: LapRecord):
    return record.layout, record.lap, record.phase, record.collisions, record.lost, record.lateral_rms_m


@pytest.mark.parametrize("phase", [Phase.UNSEEN, Phase.PROVE])
def test_laps_abreast_are_those_of_one_after_the_other(phase):
    abreast, alone = Asked(together=True), Asked(together=False)
    (records, ways), (expected, expected_ways) = laps(abreast, phase), laps(alone, phase)
    assert ways == expected_ways
    assert list(map(what_came, records)) == list(map(what_came, expected))
    assert [each.layout for each in records] == [3, 4, 5]
    assert max(abreast.counts) == 3


def test_they_are_repeatable_to_the_bit():
    assert laps(Asked(together=True))[1] == laps(Asked(together=True))[1]
