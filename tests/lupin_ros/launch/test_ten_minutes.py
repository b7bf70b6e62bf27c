"""The last minute of the page: the reader's folder, service and mission, by `lupin run` over real ROS 2."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from tests.lupin_ros.launch.processes import Lupin

pytestmark = pytest.mark.timeout(240)

PAGE = Path(__file__).parents[3] / "docs" / "ten"


@pytest.fixture
def run(lupin: Callable[..., Lupin], tmp_path: Path) -> Iterator[Lupin]:
    """Start the mission in a folder as the reader has it, and the service a moment later."""
    missions = tmp_path / "missions"
    shutil.copytree(PAGE / "bindings", missions / "bindings")
    shutil.copy(default_missions_folder() / LIFECYCLE, missions)
    shutil.copy(PAGE / "lupin.yaml", tmp_path)
    mission = shutil.copy(PAGE / "deliver.yaml", missions)
    started = lupin("run", mission, "--speed", "20")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(started.domain)}
    service = subprocess.Popen([sys.executable, str(PAGE / "server" / "tray.py")], env=environment)
    yield started
    service.terminate()
    assert service.wait(30.0) == 0


@pytest.mark.core
def test_three_places_and_one_answer(run: Lupin, lupin: Callable[..., Lupin]) -> None:
    """The robot visits its places, asks, takes the answer, and comes home."""
    run.until_line("Is the tray empty?")
    answer = lupin("answer", "yes")
    assert answer.end() == 0, answer.output
    assert run.end() == 0, run.output
    results = [line.split() for line in run.lines if line.split()[1:] == ["OK"]]
    assert results == [["door", "OK"], ["window", "OK"], ["desk", "OK"]]
    assert "parcel_left" not in run.output
    assert run.lines[-1].startswith("DONE: 3 visited of 3 targets in ")
