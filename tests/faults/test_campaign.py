"""A short selection of runs with faults, over real nodes: the same program as the long campaign."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from tests.faults.plan import plan

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

#: The orchestrator is killed in a search; its disk is full while it hangs.
SEEDS = (204, 2180)


@pytest.mark.long
def test_runs_with_faults_keep_the_guarantees(tmp_path: Path) -> None:
    """Every target has one outcome, the robot stands while nobody watches, and the mission ends."""
    line = [sys.executable, "-m", "tests.faults.campaign", "--folder", str(tmp_path)]
    done = subprocess.run(
        [*line, "--seeds", ",".join(map(str, SEEDS))],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=280,
    )
    with (tmp_path / "runs.csv").open(newline="") as file:
        runs = list(csv.DictReader(file))
    assert [run["verdict"] for run in runs] == ["ok"] * len(SEEDS), done.stdout + done.stderr
    assert {run["end"] for run in runs} == {"DONE"}
    if "one computer only" not in done.stdout:
        assert [run["plan"] for run in runs] == [str(plan(seed)) for seed in SEEDS]
    assert done.returncode == 0
