"""Whoever runs with a certificate that ends soon says so, in time and with the remedy."""

import threading
from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509
from wiring import new_endpoint, new_name, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.security import expiry
from lira.hal.bus.security.expiry import Reminder, ends_at, reminder
from lira.hal.bus.security.keys import CERTIFICATE, load_keys
from lira.tools.authority import init, renew

NOW = datetime(2030, 5, 1, 12, tzinfo=UTC)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Keys of which the laptop's end in five days."""
    monkeypatch.setattr(expiry, "_told", {})
    init(tmp_path / "keys", life=timedelta(days=5, hours=1))
    return tmp_path / "keys"


@pytest.mark.parametrize("life", [timedelta(days=5), timedelta(days=365 * 40)])  # two forms of a date
def test_its_end_is_read_as_a_library_reads_it(folder, life):
    renew(folder, "laptop", life)
    path = folder / "laptop" / CERTIFICATE
    assert ends_at(path) == x509.load_pem_x509_certificate(path.read_bytes()).not_valid_after_utc


def test_what_is_no_certificate_is_no_certificate(tmp_path):
    path = tmp_path / CERTIFICATE
    for text in ("", "-----BEGIN CERTIFICATE-----\nMAMwAQU=\n-----END CERTIFICATE-----\n"):
        path.write_text(text)
        with pytest.raises(ValueError):
            ends_at(path)


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (timedelta(days=8, hours=1), ""),
        (timedelta(days=7, hours=1), "ends on 2030-05-08, in 7 days. Renew it where the keys were made"),
        (timedelta(hours=1), "ends on 2030-05-01, in 0 days"),
        (timedelta(days=-3), "ended on 2030-04-28. Renew it"),
    ],
)
def test_it_is_told_a_week_ahead_with_the_remedy(left, words):
    line = reminder("laptop", NOW + left, NOW)
    assert words in line
    assert bool(line) is bool(words)
    assert "\n" not in line
    assert not line or "lira keys renew laptop" in line


def test_a_session_says_it_at_its_start_and_a_process_once(folder, capsys):
    keys, endpoint = load_keys(folder / "laptop"), new_endpoint()
    sessions = [Bus(new_name(), connect=endpoint, keys=keys) for _ in range(2)]
    for session in sessions:
        assert session.close()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: the certificate of 'laptop' ends on ")
    assert "lira keys renew laptop" in line


def test_what_lasts_is_not_told(folder, capsys):
    bus = Bus(new_name(), listen=new_endpoint(), keys=load_keys(folder / "robot"))
    assert bus.close()
    assert capsys.readouterr().err == ""


def test_it_is_told_again_every_day_until_it_is_renewed(folder, capsys, monkeypatch):
    monkeypatch.setattr(expiry, "DAY_S", 0.05)
    lines = []
    running = Reminder(load_keys(folder / "laptop"))

    def told():
        lines.extend(capsys.readouterr().err.splitlines())
        return len(lines)

    try:
        wait_for(lambda: told() >= 3)
        renew(folder, "laptop")
        told()
        lines.clear()
        threading.Event().wait(0.3)
        assert told() <= 1  # which was under way
    finally:
        running.close()
