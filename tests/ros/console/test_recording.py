"""A run over ROS is recorded, and shown again without ROS: its states over time are those of its steps."""

from __future__ import annotations

import json
import os
import re
import subprocess
from itertools import groupby
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")
pytest.importorskip("mcap_ros2", reason="the extra record is not installed here")

from playwright.sync_api import BrowserContext, expect

from lupin_engine.harness.domains import claimed_domain
from tests.browsing import opened
from tests.console.pages import LUPIN, STATE, STEPS, ServedPages


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two tags are visited by the simulated robot, recorded from the start to the end."""
    folder = tmp_path_factory.mktemp("run")
    file = folder / "run.mcap"
    with claimed_domain() as domain:
        arguments = ["run", "inspection", "--tags", "1,2", "--speed", "8", "--record", str(file)]
        options = ["--domain", str(domain), "--log-dir", str(folder / "logs")]
        told = subprocess.run(
            [*LUPIN, *arguments, *options, "--set", "estop_timeout_s=20 s"],
            capture_output=True,
            text=True,
            env={**os.environ, "XDG_STATE_HOME": str(folder / "state")},
            timeout=240,
            check=False,
        )
    assert file.exists(), f"{told.stdout}\n{told.stderr}"
    return file


def test_the_states_of_a_recorded_run_are_those_of_its_steps(context: BrowserContext, run: Path) -> None:
    with ServedPages("replay", str(run)) as served:
        lines = served.history()
        steps = [json.loads(line["msg"]["data"]) for line in lines if line["topic"] == STEPS]
        states = [line["msg"] for line in lines if line["topic"] == STATE]
        lived = [name for name, _ in groupby(step["view"]["lifecycle"] for step in steps)]
        assert lived[-3:] == ["INSPECTING", "RETURNING", "DONE"]
        assert [name for name, _ in groupby(state["lifecycle_state"] for state in states)] == lived
        assert states[-1]["targets_completed"] == 2
        assert {line["topic"] for line in lines} >= {"/tf", "/map", "/amcl_pose", "/floranova/observations"}
        for page in opened(context, f"{served.url}#log"):
            shown = page.locator(".control-where")
            expect(shown).to_contain_text("DONE")
            for step in reversed(steps[-25:]):
                page.get_by_role("button", name="Step before").click()
                now = " ".join(filter(None, (step["view"]["lifecycle"], step["view"]["phase"])))
                expect(shown).to_contain_text(now)
            # At any moment each view shows what was known then: the bar too, which reads MissionState.
            page.locator(".virtual").get_by_role("button", name="To the begin").click()
            expect(page.locator(".bar .where")).not_to_contain_text("DONE")
            page.locator(".virtual").get_by_label("Speed").select_option("64")
            page.locator(".virtual").get_by_role("button", name="Play").click()
            expect(page.locator(".bar .where")).to_contain_text(re.compile("INSPECTING|RETURNING|DONE"))
            expect(page.locator(".bar .where b")).to_have_text("DONE")
            expect(page.get_by_role("button", name="Abort")).to_be_disabled()
