"""The table of tags after a mission of real nodes."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Page, expect

from tests.lupin_ros.system.console.asking import command

pytestmark = pytest.mark.long


@pytest.fixture
def tags(console: Page) -> Page:
    """The table, when a mission has found and looked at tags."""
    console.evaluate("location.hash = 'twin'")
    answer = command(console, "start", "ExplorationMission", '{"discovery_goal": 3}')
    assert answer["accepted"] or "already running" in answer["message"], answer
    expect(console.locator(".twin tbody .pill", has_text="scanned").nth(1)).to_be_visible()
    return console


def ids(page: Page) -> list[str]:
    """The tags in the order in which they are shown."""
    return [text.strip("✓ ") for text in page.locator(".twin button.tag").all_inner_texts()]


def test_a_mission_fills_the_table_and_it_is_saved_sorted_and_searched(tags: Page, tmp_path: Path) -> None:
    """What is seen is what is exported; keys go through the rows, and Enter leads to the map."""
    known = ids(tags)
    assert known == sorted(known, key=int)
    assert len(known) >= 2
    row = tags.locator(".twin tbody tr").filter(has=tags.locator(".pill", has_text="scanned")).first
    expect(row).to_contain_text("ago")
    expect(row.locator("svg.spark[aria-label*='readings since']").first).to_be_visible()

    tags.locator("th button", has_text="Tag").click()
    expect(tags.locator("th[aria-sort=descending]")).to_have_count(1)
    before = ids(tags)
    assert before == sorted(before, key=int, reverse=True)

    with tags.expect_download() as saving:
        tags.get_by_role("button", name="Export as CSV").click()
    file = tmp_path / "tags.csv"
    saving.value.save_as(file)
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    saved = [line["tag"] for line in rows]
    assert saved == sorted(saved, key=int, reverse=True)
    assert set(before) <= set(saved) <= set(ids(tags)), "the search goes on meanwhile"
    assert {line["last outcome"] for line in rows} >= {"ok"}
    columns = list(rows[0])
    sensors = columns[columns.index("detail") + 1 :]
    assert sensors
    assert all(any(float(line[sensor] or 0) > 0 for line in rows) for sensor in sensors)

    first, second = ids(tags)[:2]
    tags.locator(f"button.tag[data-tag='{first}']").focus()
    tags.keyboard.press("ArrowDown")
    expect(tags.locator(f"button.tag[data-tag='{second}']")).to_be_focused()
    tags.keyboard.press("Enter")
    tags.wait_for_url(f"**/#map/{second}")
    tags.evaluate("location.hash = 'twin'")
    tags.get_by_role("searchbox").fill(f"no tag {second}")
    expect(tags.locator(".twin button.tag")).to_have_count(0)
    expect(tags.locator(".twin p[role=status]")).to_contain_text("0 of")


def test_a_form_that_asks_for_tags_is_filled_from_the_table(tags: Page) -> None:
    """Who picks tags for a field toggles them here; the map is not opened."""
    mission = tags.get_by_role("complementary", name="Mission")
    command(tags, "abort")
    for form in mission.locator("details").all():
        form.evaluate("each => each.open = true")
    mission.get_by_role("button", name="Pick on the map").first.click()
    tags.evaluate("location.hash = 'twin'")
    first = tags.locator(".twin button.tag").first
    expect(first).to_be_visible()
    expect(first).to_have_attribute("aria-label", f"Tag {ids(tags)[0]}: choose it")
    first.click()
    expect(first).to_have_attribute("aria-pressed", "true")
    expect(tags.locator(".twin p[role=status]")).to_contain_text("tag_sequence")
    mission.get_by_role("button", name="Done picking").click()
    expect(first).not_to_have_attribute("aria-pressed", "true")
    expect(mission.locator("input[id$=tag_sequence]")).to_have_value(ids(tags)[0])
