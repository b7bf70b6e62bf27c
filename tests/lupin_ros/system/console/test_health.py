"""How nodes are, and what the page says of one that was killed."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Page, ViewportSize, expect

from tests.lupin_ros.system.console.conftest import PHONE, Served

pytestmark = pytest.mark.long

SINCE = re.compile(r"not heard since \d+:\d\d:\d\d")


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served]) -> Served:
    """Nodes that are not started again when they die."""
    return serve("up", "--speed", "4", "--no-respawn", "--separate")


def number(text: str) -> float:
    """The number in a cell."""
    return float(text.split()[0].replace(",", ""))


def test_nodes_tell_how_they_are(console: Page) -> None:
    console.evaluate("location.hash = 'health'")
    row = console.get_by_role("row", name="/mission_orchestrator")
    expect(row).to_contain_text("running")
    cells = row.locator("td").all_inner_texts()
    assert 0 <= number(cells[3]) < 200
    assert 20 < number(cells[4]) < 1000
    row.locator("summary").click()
    expect(row.locator("li", has_text="/mission/state")).to_contain_text(re.compile(r"[456](\.\d)? Hz"))
    machine = console.locator(".machine")
    expect(machine.get_by_role("meter")).to_have_count(3)
    expect(machine).to_contain_text(re.compile(r"[\d.]+ GB free of [\d.]+ GB"))
    expect(console.locator("section", has=console.get_by_role("heading", name="Battery"))).to_contain_text(
        "%"
    )


def test_a_node_that_is_killed_is_grey_and_says_since_when(console: Page, robot: Served) -> None:
    """It is also a notification, on every view."""
    console.evaluate("location.hash = 'health'")
    row = console.get_by_role("row", name="/lupin_twin")
    expect(row).to_contain_text("running")
    os.kill(robot.lupin.pid_of("lupin_twin"), signal.SIGKILL)
    expect(row.locator(".pill")).to_have_text(SINCE)
    expect(row).to_have_class("gone")
    expect(console.locator("nav .badge")).to_contain_text("1")
    console.evaluate("location.hash = 'people'")
    expect(console.locator(".notices li.open")).to_contain_text("/lupin_twin is not heard any more")
    console.evaluate("location.hash = 'twin'")
    expect(console.locator(".twin p[role=status]")).to_contain_text("the digital twin tells nothing")


def test_a_page_that_comes_later_knows_it_too(console: Page) -> None:
    """It has never heard the node."""
    console.evaluate("location.hash = 'health'")
    row = console.get_by_role("row", name="/lupin_twin")
    expect(row.locator(".pill")).to_have_text(SINCE)
    # On a phone a row is a card: nothing lies beside the screen, and it is a row of a table still.
    console.set_viewport_size(ViewportSize(**PHONE))
    row.locator(".pill").scroll_into_view_if_needed()
    expect(row.locator(".pill")).to_be_in_viewport()
    assert console.locator(".health .scroll").evaluate("(it) => it.scrollWidth <= it.clientWidth")
    expect(console.get_by_role("row", name="/mission_orchestrator").get_by_role("cell")).to_have_count(6)


def test_a_warning_in_the_log_comes_to_the_top(console: Page) -> None:
    """The arm warns of a joint that it does not move, because its servos are off."""
    console.evaluate("location.hash = 'arm'")
    arm = console.locator(".arm")
    arm.get_by_role("button", name="Switch the servos off").click()
    arm.get_by_role("button", name="Yes").click()
    expect(arm.locator(".arm-state")).to_contain_text("servos off")
    arm.get_by_label("elbow", exact=True).press("ArrowRight")
    console.evaluate("location.hash = 'health'")
    expect(console.locator(".loglines li").first).to_contain_text("elbow not moved")
    console.get_by_label("Which lines").select_option("error")
    expect(console.locator(".loglines li", has_text="elbow not moved")).to_have_count(0)
