"""What waits for the disk: bounded, pictures give way first, and what is lost is counted."""

from samples import odom, picture, scan

from lira.hal.bus.topics import CAMERA, ODOM
from lira.tools.recording.backlog import Backlog


def keys(samples):
    return [each.key for each in samples]


def test_what_fits_is_taken_in_order_and_nothing_is_lost():
    backlog = Backlog(10_000)
    pushed = [odom(0, 1.0), picture(1, 1.0), scan(2, 1.0)]
    for each in pushed:
        backlog.push(each)
    assert backlog.take() == pushed
    assert backlog.take() == []
    assert not backlog.lost


def test_the_oldest_pictures_give_way_to_whatever_comes():
    backlog = Backlog(7000)
    for number in range(3):
        backlog.push(picture(number, 1.0))
        backlog.push(odom(number, 1.0))
    backlog.push(picture(3, 1.0))
    kept = backlog.take()
    assert [each for each in kept if each.key == ODOM.key] == [odom(number, 1.0) for number in range(3)]
    assert [each for each in kept if each.key == CAMERA.key] == [picture(2, 1.0), picture(3, 1.0)]
    assert backlog.lost == {CAMERA.key: 2}


def test_without_pictures_what_comes_is_not_taken_and_what_waits_stays():
    backlog = Backlog(2 * len(odom(0, 1.0).payload))
    for number in range(3):
        backlog.push(odom(number, 1.0))
    assert backlog.take() == [odom(0, 1.0), odom(1, 1.0)]
    assert backlog.lost == {ODOM.key: 1}


def test_after_all_was_taken_there_is_room_again():
    backlog = Backlog(5000)
    for round_ in range(5):
        for number in range(4):
            backlog.push(picture(number, 1.0))
        assert keys(backlog.take()) == [CAMERA.key] * 2
        assert backlog.bytes == 0
        assert backlog.lost[CAMERA.key] == 2 * (round_ + 1)
