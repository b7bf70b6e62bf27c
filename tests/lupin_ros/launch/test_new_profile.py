"""A profile that has just begun, over real ROS 2: its words, its messages, its requests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_cli.main import main
from tests.lupin_ros.launch.processes import Lupin
from tests.workbench.lupin_cli.test_new_profile import install

pytestmark = pytest.mark.timeout(240)


def test_it_runs_at_once(
    lupin: Callable[..., Lupin], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a robot: the mission is done, and each place has its outcome."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "rounds", "--profile", "courier"]) == 0
    install(tmp_path / "lupin-courier", tmp_path / "site")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "site"))
    run = lupin("run", "rounds", "--places", "x,y")
    assert run.end() == 0, run.output
    results = [line.split() for line in run.lines if line.split()[1:] == ["VISITED"]]
    assert results == [["x", "VISITED"], ["y", "VISITED"]]
    assert run.lines[-1].startswith("ENDED: 2 visited of 2 targets in ")
