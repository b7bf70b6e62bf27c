"""`lupin missions` and `lupin why`: a real run explained from its journal, when nothing runs any more."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable

import pytest

from tests.ros.launch.processes import Lupin

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")
pytestmark = pytest.mark.timeout(240)


def test_a_run_that_is_over_is_listed_and_explained(lupin: Callable[..., Lupin]) -> None:
    run = lupin("run", "inspection", "--tags", "1,2", "--speed", "10")
    run.process.wait(200)

    def ask(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "lupin_engine.cli.main", *words, "--domain", str(run.domain)]
        environment = {**os.environ, "XDG_STATE_HOME": str(run.state)}
        return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)

    (mission,) = json.loads(ask("missions", "--json").stdout)
    assert (mission["mission"], mission["end"]["state"], mission["restarts"]) == (
        "InspectionMission",
        "DONE",
        0,
    )
    assert mission["end"]["completed"] == 2
    assert "2 completed of 2" in ask("missions").stdout

    told = ask("why", "tag", "2").stdout
    assert re.match(r"InspectionMission lupin-\w+, \d{4}-\d\d-\d\d \w+: tag 2 is OK\n", told)
    assert re.search(r"^\d\d:\d\d:\d\d   bridge.read_tag done$", told, re.MULTILINE)
    assert "publish 2 OK\n" in told
    assert "(itinerary.remaining was 1, context.unreachable was 0, itinerary.total was 2)" in told.replace(
        "\n              ", " "
    )

    causes = json.loads(ask("why", "DONE", "--json").stdout)["causes"]
    assert causes[0]["event"] == "nav.dock done"
    assert causes[0]["because"][0]["file"].endswith("lifecycle.yaml")

    unknown = ask("why", "DOCKD")
    assert unknown.returncode == 2
    assert unknown.stderr == (
        "lupin: no state is called 'DOCKD'; did you mean 'DOCKED'?\n"
        "this run knows of no tag 'DOCKD'; allowed: '1', '2'\n"
    )
