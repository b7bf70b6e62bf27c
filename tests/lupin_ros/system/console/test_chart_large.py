"""The chart of a mission with hundreds of states, and markup in every text."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import BrowserContext, expect

from tests.lupin_ros.system.console.conftest import Served
from tests.lupin_ros.system.console.large import MARKUP, large_missions
from tests.lupin_ros.system.console.test_chart import command, lit, state

pytestmark = pytest.mark.long

#: A name that nobody may give.
BROKEN = "<img src=x onerror=pwned=1>. é"


def test_hundreds_of_states_with_markup_run_nothing_and_a_new_chart_is_told(
    context: BrowserContext, serve: Callable[..., Served], tmp_path: Path
) -> None:
    """A large chart is opened folded; when the files change, the page says so and draws anew.

    What is no mission, because its names are broken, is told as text, and changes nothing.
    """
    folder = large_missions(tmp_path / "missions", 300, across=True)
    served = serve("up", str(folder / "large.yaml"), str(folder / "inspection.yaml"))
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda problem: wrong.append(str(problem)))
    page.goto(f"{served.url}#chart/MISSION.LargeMission.GROUP_0.A_0")
    expect(page.locator(".detail pre")).to_contain_text(MARKUP.replace("'", "''"))
    assert page.locator(".paper [data-state]").count() < 100
    expect(state(page, "MISSION.LargeMission.GROUP_0.A_1")).to_have_count(1)
    page.get_by_label("Depth").select_option("4")
    expect(state(page, "MISSION.LargeMission.GROUP_29.A_7")).to_have_count(1)
    expect(page.locator(".bar .where")).to_contain_text("READY")
    command(page, "start", "LargeMission")
    lit(page, "MISSION.LargeMission.GROUP_0.A_2", "innermost")
    assert page.locator("main :is(script, img), .paper b, .detail b").count() == 0
    assert page.evaluate("typeof pwned") == "undefined"
    command(page, "abort")
    expect(page.locator(".bar .where")).to_contain_text("DONE")
    large_missions(folder, 40, again="again")
    expect(page.locator(".note.info")).to_contain_text("this is another chart")
    expect(state(page, "MISSION.LargeMission.GROUP_29")).to_have_count(0)
    expect(state(page, "MISSION.LargeMission.GROUP_3")).to_have_count(1)
    large = folder / "large.yaml"
    large.write_text(f"{large.read_text()}  '{BROKEN}': {{on: {{'{BROKEN}': GROUP_0}}}}\n", encoding="utf-8")
    page.get_by_role("link", name="Mission").click()
    expect(page.get_by_text(re.compile(re.escape(f"'{BROKEN}'"))).first).to_be_visible()
    assert page.locator("main :is(script, img), .paper b, .detail b").count() == 0
    assert page.evaluate("typeof pwned") == "undefined"
    expect(page.get_by_role("button", name=re.compile("^start large"))).to_be_enabled()
    assert wrong == []
