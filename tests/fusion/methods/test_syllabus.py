"""Which layouts are taught, proven and shown: never the same, unless the thesis says so."""

import pytest

from lira.fusion.methods.presets import method_named
from lira.fusion.methods.syllabus import FRESH, THESIS, Syllabus, with_proof
from lira.hal.errors import ConfigError


def test_the_thesis_teaches_and_proves_on_one_layout():
    assert [THESIS.taught(7, lap) for lap in (1, 2)] == [7, 7]
    assert THESIS.proven(7, 2) == [7]


def test_fresh_layouts_are_each_driven_once_in_a_run_and_in_no_other():
    laps = range(1, 13)
    taught = [FRESH.taught(run, lap) for run in (0, 1, 300) for lap in laps]
    proven = [layout for run in (0, 1, 300) for lap in laps for layout in FRESH.proven(run, lap)]
    assert len({*taught, *proven}) == len(taught) + len(proven)
    assert min(*taught, *proven) > 1_000_000  # those that are shown afterwards are below


def test_a_lap_of_ones_own_can_be_proven_on_others():
    syllabus = Syllabus("own", 3)
    assert syllabus.taught(7, 2) == 7
    assert len(syllabus.proven(7, 2)) == 3
    assert 7 not in syllabus.proven(7, 2)


@pytest.mark.parametrize("words", ["own", "fresh:3", "fresh:12", "fresh:11/12"])
def test_a_proof_is_read_and_written(words):
    syllabus = with_proof(FRESH, words)
    assert syllabus.proof == words
    assert syllabus.layouts == "fresh"


@pytest.mark.parametrize(
    "words",
    ["", "fresh", "fresh:0", "fresh:-1", "fresh:x", "fresh:81", "mine", "own:3", "fresh:4/3", "fresh:0/3", "fresh:3/"],
)
def test_what_is_no_proof_is_refused_with_an_example(words):
    with pytest.raises(ConfigError) as error:
        with_proof(THESIS, words)
    assert "fresh:3" in error.value.remedy


def test_a_preset_is_taught_as_the_words_of_a_verb_say_and_else_as_it_is():
    plus = method_named("plus")
    assert plus.taught() == plus
    own = plus.taught(layouts="own", proof="own", idle_frames="skip")
    assert (own.syllabus, own.learning.idle_frames) == (THESIS, "skip")
    assert own.approach == plus.approach
    with pytest.raises(ConfigError, match="is no proof"):
        plus.taught(proof="fresh")
    assert method_named("hold").taught(start="experts").approach.start == "experts"
