"""The words for what was proven, and the interval behind them."""

import msgspec
import pytest
from made_up_outcomes import lap

from lira.fusion.log.run_log import ContradictionRecord, ResultRecord
from lira.tools.output.proven import contradiction_words, proof_words, share, share_words, unseen_words


@pytest.mark.parametrize(
    ("passed", "laps", "low", "high"),
    [
        (12, 12, 0.7354, 1.0),
        (0, 12, 0.0, 0.2646),
        (3, 3, 0.2924, 1.0),
        (8, 10, 0.4439, 0.9748),
        (257, 300, 0.8118, 0.8943),
    ],
)
def test_the_interval_is_the_one_in_the_tables(passed, laps, low, high):
    assert share(passed, laps) == pytest.approx((low, high), abs=1e-3)


def test_thousands_of_laps_are_no_trouble():
    low, high = share(2970, 3000)
    assert 0.985 < low < 0.99 < high < 0.995


def test_it_covers_the_true_rate_as_often_as_it_says():
    from math import comb

    rate, laps = 0.9, 12
    covered = sum(
        comb(laps, k) * rate**k * (1 - rate) ** (laps - k)
        for k in range(laps + 1)
        if share(k, laps)[0] <= rate <= share(k, laps)[1]
    )
    assert covered >= 0.95


def test_a_share_says_how_sure_it_is():
    assert share_words(12, 12) == "12 of 12 unseen layouts; 95 %: 74 to 100 %"


def result(converged, laps, proof):
    return ResultRecord(converged, laps, 20, 0, 5, 9, 90, 90, 120.0, 6.0, proof=proof)


def test_the_proof_is_named_for_what_it_was():
    assert proof_words(result(True, 1, "fresh:3")) == (
        "proven after 1 training lap: the novice alone passed 3 fresh layouts in a row"
    )
    assert proof_words(result(True, 2, "fresh:11/12")).endswith("passed 11 of 12 fresh layouts")
    assert proof_words(result(False, 12, "own")) == (
        "not proven within 12 training laps: the novice alone did not pass the layout it was taught on"
    )


def test_a_novice_that_nobody_helped_is_said_to_be_one():
    alone = ResultRecord(False, 12, 0, 0, 0, 26, 41, 41, 600.0, 6.0, proof="fresh:3")
    assert proof_words(alone).endswith("; while it was taught nobody ever took over, so nobody showed it the way back")
    assert proof_words(msgspec.structs.replace(alone, interventions=1)).endswith(
        "did not pass 3 fresh layouts in a row"
    )


def test_what_went_wrong_on_unseen_layouts_is_said():
    laps = [lap("unseen"), lap("unseen", passed=False, collisions=2), lap("unseen", passed=False, lost=1)]
    assert unseen_words(laps) == (
        "alone it passed 1 of 3 unseen layouts; 95 %: 1 to 91 %; collisions: 2, lost lines: 1"
    )
    assert unseen_words([]) == ""


def test_a_label_whose_mirror_image_alone_contradicts_is_not_said_to_be_left_out():
    itself = ContradictionRecord(7, "human", 1, (0.0, -1.0), (0.4, 0.36), given_s=78.6)
    image = ContradictionRecord(3, "human", 1, (0.0, 1.0), (0.0, -0.82), mirrored=True)
    own = "this label contradicts the rest and is not followed: 7 (human, lap 1, 78.6 s: turn -1.00, the "
    assert contradiction_words([itself]) == f"{own}others +0.36)"
    mirrored = "the mirror image of this label contradicts the rest and is not followed: 3 (human, lap 1: "
    assert contradiction_words([image, itself]) == (f"{own}others +0.36); {mirrored}turn -1.00, the others +0.82)")
    assert "the mirror images of these 2 labels contradict the rest and are" in contradiction_words([image, image])
