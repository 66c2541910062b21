"""What zenoh's log tells of those it kept out. That zenoh writes such a log is tested with keys, in tests/tools."""

from lira.hal.bus.security.access_log import FULL, LINK, MESSAGE, Refusals

TLS = b"2026-01-01T00:00:00Z  WARN acc-0 ThreadId(05) zenoh_link_tls::unicast: received corrupt message of type X."
HINT = b" Hint: increase the system open file limit.\n"
OUT_OF_FILES = b"2026-01-01T00:00:00Z  WARN acc-0 zenoh_link_tls::unicast: Too many open files (os error 24)." + HINT
QUIC = b"2026-01-01T00:00:00Z  WARN acc-0 zenoh_link_commons::quic::unicast: QUIC acceptor failed: X." + HINT
PUT = b"2026-01-01T00:00:00Z TRACE  rx-1 ThreadId(11) zenoh::net::routing::interceptor: Msg intercepted!\n"


def test_links_and_messages_are_counted_and_the_rest_is_handed_back():
    refusals = Refusals()
    assert refusals.counts == {LINK: 0, FULL: 0, MESSAGE: 0}
    assert refusals.feed(TLS + HINT + QUIC + PUT + b"twin serves\n" + PUT) == [b"twin serves"]
    assert refusals.counts == {LINK: 2, FULL: 0, MESSAGE: 2}


def test_a_line_may_come_in_pieces():
    refusals = Refusals()
    line = TLS + HINT
    assert [refusals.feed(line[at : at + 7]) for at in range(0, len(line), 7)][-1] == []
    assert refusals.counts[LINK] == 1


def test_a_process_out_of_files_is_told_from_a_bad_certificate():
    refusals = Refusals()
    assert refusals.feed(OUT_OF_FILES) == []
    assert refusals.counts == {LINK: 0, FULL: 1, MESSAGE: 0}
