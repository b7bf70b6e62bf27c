"""A cell of the matrix whose page A is the console in a real browser; the others are in `system/safety`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import BrowserContext, expect

from tests.lupin_ros.system.safety.matrix.bench import Bench
from tests.lupin_ros.system.safety.matrix.cell import carry_out
from tests.lupin_ros.system.safety.matrix.table import DURING, cell

#: Milliseconds for which a finger stays on what releases a stop.
HOLD_MS = 1500


@pytest.fixture
def bench(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """All nodes."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    bench = Bench(tmp_path)
    yield bench
    assert bench.close() == []


def test_the_stop_of_a_page_in_a_browser_holds_a_mission(
    bench: Bench, context: BrowserContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.reset({})
    page = context.new_page()
    page.goto(bench.url)
    page.locator(".bar .pill.good").wait_for()
    monkeypatch.setattr(bench, "stop_of_a", lambda: page.locator("#stop").click())
    monkeypatch.setattr(bench, "a_lets_go", lambda: page.locator("#release").click(delay=HOLD_MS))
    result = carry_out(bench, cell("mission", "stop_a", DURING))
    assert result.problems == [], result
    expect(page.locator("#stop-state")).to_contain_text("Stopped by page-")
