"""A real browser for the console, with a fresh profile for each test."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

#: Milliseconds that the page may take for anything on a busy machine.
PATIENCE_MS = 60_000
expect.set_options(timeout=PATIENCE_MS / 2)
#: Chromium without a screen, and without asking the world for anything.
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
DESK = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}
#: Milliseconds for which a press is held that is to release a stop.
HOLD_MS = 1_400


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium, as Debian has it; for a module: its loop is in the way of other tests."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium is installed here: apt install chromium")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield found
        found.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A fresh profile, in English, on a desk."""
    found = browser.new_context(viewport=DESK, locale="en-GB", timezone_id="Europe/Amsterdam")
    found.set_default_timeout(PATIENCE_MS)
    yield found
    found.close()


def opened(context: BrowserContext, url: str) -> Iterator[Page]:
    """Yield a page that is connected; what it logs as an error fails the test when that has ended."""
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda problem: wrong.append(str(problem)))
    page.on("console", lambda told: wrong.append(told.text) if told.type == "error" else None)
    page.goto(url)
    page.locator(".bar .pill.good").wait_for()
    yield page
    assert not wrong, "\n".join(wrong)
