"""The gateway's own page shows who stops the robot, and resets what a page has left."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.npm import installed, run_node
from tests.plugins.gateway.served import OpenPage, ServedGateway, until

pytestmark = [pytest.mark.node, pytest.mark.timeout(300)]


def test_a_stop_that_a_page_has_left_is_reset_by_a_button(tmp_path: Path) -> None:
    """In a document as a browser has it: the page is served, and speaks with the gateway."""
    folder = installed("jsdom@24.1.3")
    with ServedGateway(tmp_path) as gateway:
        page = OpenPage(gateway.port)
        page.stop(True)
        page.work_off()
        page.close()
        until(lambda: gateway.states[-1]["stops"][0]["left"], "it is left")
        script = Path(__file__).with_name("reset_by_page.mjs")
        told: dict[str, Any] = json.loads(run_node(script, folder, f"http://localhost:{gateway.port}/"))
    assert told == {
        "before": ["The robot is stopped by:", "page-1, which is gone Reset page-1"],
        "after": ["No page stops the robot. Operators' link: up.", "the stop of page-1 is released"],
    }
