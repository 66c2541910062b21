"""What the page costs, and how soon it shows something, as `lira bench web` measures it."""

import pytest

pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'lira-rosbot[web]'")
from lira.tools.bench import web


@pytest.mark.alone
def test_the_page_is_small_soon_there_and_cheap(monkeypatch):
    monkeypatch.setattr(web, "WATCH_S", 2.0)
    soon, cost = web.run()
    assert soon["KiB"] < 300.0
    assert soon["ms"] < 1000.0
    assert cost["core"] < 0.25
    assert cost["frames_hz"] > 20.0
    assert cost["pictures_hz"] > 10.0
