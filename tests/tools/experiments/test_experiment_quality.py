"""A real trial that is taught to a quality, on a short world; and how worlds and robots are shifted for it."""

import msgspec
import pytest
from short_trials import write_world

from lira.fusion.methods.presets import METHODS
from lira.fusion.methods.syllabus import with_proof
from lira.fusion.teaching.teacher import PERFECT
from lira.tools.experiments.quality import WAYS, Quality
from lira.tools.experiments.trial import Trial, play

TO = Quality(layouts=2, ways=WAYS, shift="noise", more=1)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    world = write_world(tmp_path_factory.mktemp("world"))
    plus = METHODS["plus"]
    plus = msgspec.structs.replace(plus, syllabus=with_proof(plus.syllabus, "fresh:2"))
    return play(Trial(plus, world, 0, "perfect", PERFECT, laps=2, unseen=1, quality=TO))


def test_after_each_lap_fresh_layouts_are_driven_and_counted_as_long_as_a_level_can_be_reached(outcome):
    first = outcome.points[0]
    laps = [lap for lap in outcome.laps if lap.phase == "prove" and lap.lap == 1]
    assert (first.lap, first.layouts, first.passed) == (1, len(laps), sum(lap.passed for lap in laps))
    assert first.layouts == (2 if laps[0].passed else 1)
    assert 2.5 < first.driven_m < 14.0
    assert first.human_labels == laps[0].human_labels
    assert outcome.after(1).phase == "train"


def test_who_reaches_the_lowest_level_is_tried_in_every_way_and_once_more_after_the_laps_that_follow(outcome):
    reached = any(point.reaches(0.9, TO.layouts) for point in outcome.points)
    assert outcome.result.converged == reached  # of two layouts all levels ask for both
    tried = [(each.levels, each.way) for each in outcome.judged]
    assert tried == [*((TO.levels, way) for way in WAYS if reached), ((), "plain")]
    assert all(each.layouts == 1 for each in outcome.judged)
    assert len(outcome.points) == outcome.result.laps
    assert not outcome.tracks


def test_a_higher_cap_of_laps_shows_more_of_who_is_not_there_yet_and_changes_nothing_else(outcome):
    trial = msgspec.structs.replace(outcome.trial, quality=msgspec.structs.replace(TO, ways=("plain",), more=0))
    low, high = (play(msgspec.structs.replace(trial, laps=laps)) for laps in (1, 2))
    assert high.points[: len(low.points)] == low.points == outcome.points[:1]
    assert high.judged[: len(low.judged)] == low.judged
    assert (len(high.points) == 1) == low.result.converged
