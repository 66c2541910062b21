"""One line of time: what was recorded when, and sent when, whichever clock says so."""

from lira.hal.bus.attachment import Attachment
from lira.tools.recording.timeline import TimeLine

SECOND = 1_000_000_000


def sent(time_s):
    return Attachment(1, 0, round(time_s * SECOND))


def test_in_real_time_a_message_is_recorded_when_it_came_and_sent_when_its_sender_says():
    line = TimeLine(100 * SECOND, 90 * SECOND, lockstep=False)
    assert line.times(15.5, sent(5.0)) == (105.5 * SECOND, 105 * SECOND)


def test_who_does_not_say_when_or_has_another_clock_sent_it_when_it_came():
    line = TimeLine(100 * SECOND, 90 * SECOND, lockstep=False)
    assert line.times(15.5, None) == (105.5 * SECOND, 105.5 * SECOND)
    assert line.times(15.6, sent(900.0)) == (105.6 * SECOND, 105.6 * SECOND)


def test_nobody_leaps_with_it_by_a_day_or_before_all_time():
    line = TimeLine(100 * SECOND, 90 * SECOND, lockstep=True)
    assert line.times(15.0, sent(5.0)) == (105 * SECOND, 105 * SECOND)
    for wild_s in (90_000.0, -4e9):
        assert line.times(15.0, sent(wild_s)) == (105 * SECOND, 105 * SECOND)
    assert line.times(15.0, sent(6.0)) == (106 * SECOND, 106 * SECOND)


def test_in_lockstep_it_is_the_robots_time_that_passes_and_it_never_runs_back():
    line = TimeLine(100 * SECOND, 90 * SECOND, lockstep=True)
    assert line.times(15.0, sent(5.0)) == (105 * SECOND, 105 * SECOND)
    assert line.times(15.1, sent(65.0)) == (165 * SECOND, 165 * SECOND)
    assert line.times(15.2, None) == (165 * SECOND, 165 * SECOND)
    assert line.times(15.3, sent(60.0)) == (165 * SECOND, 160 * SECOND)
