"""Every view, light and dark, on a desk and on a phone, by axe: names, roles, contrast, keyboard."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, Page, ViewportSize

from tests.lupin_ros.system.console.conftest import DESK, PATIENCE_MS, PHONE, Served
from tests.npm import installed

pytestmark = [pytest.mark.node, pytest.mark.long]
VIEWS = ("control", "chart", "map", "log", "twin", "arm", "health", "people")


@pytest.fixture(params=[("light", DESK), ("dark", DESK), ("light", PHONE)], ids=["light", "dark", "phone"])
def page(request: pytest.FixtureRequest, browser: Browser, robot: Served) -> Iterator[Page]:
    """The console with axe in it."""
    scheme, size = request.param
    context = browser.new_context(viewport=ViewportSize(**size), color_scheme=scheme, locale="en-GB")
    context.set_default_timeout(PATIENCE_MS)
    found = context.new_page()
    found.goto(robot.url)
    found.locator(".bar .pill.good").wait_for()
    axe = installed("axe-core@4.10.3") / "node_modules" / "axe-core" / "axe.min.js"
    found.evaluate(axe.read_text(encoding="utf-8"))
    yield found
    context.close()


def test_axe_finds_nothing_in_any_view(page: Page) -> None:
    wrong: list[str] = []
    for view in VIEWS:
        page.evaluate(f"location.hash = '{view}'")
        page.locator(f"nav a[href='#{view}'][aria-current=page]").wait_for()
        page.locator(".view .panel").first.wait_for()
        found: dict[str, Any] = page.evaluate("axe.run()")
        for violation in found["violations"]:
            places = ", ".join(str(node["target"][0]) for node in violation["nodes"][:3])
            wrong.append(f"{view}: {violation['id']}: {violation['help']}: {places}")
    assert not wrong, "\n".join(wrong)
