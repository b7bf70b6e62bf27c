"""How near a run came to a breach: numbers while the rest of a breach is true, and times of what is due."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.properties.margins import MarginMonitor
from tests.lupin_engine.properties.test_live import Robot, chart_with

CHARGED = ((1.0, 0.9), (2.0, 0.162), (3.0, 0.4))
SAYS = {
    "never: \"input.battery < '15 %'\"": "input.battery 16.2 of 15 %",
    "always: \"input.battery >= '15 %'\"": "input.battery 16.2 of 15 %",
    "never: \"'15 %' > input.battery\"": "input.battery 16.2 of 15 %",
    "never: \"not input.estop and input.battery < '15 %'\"": "input.battery 16.2 of 15 %",
    "never: \"input.estop and input.battery < '15 %'\"": None,
    "never: \"input.battery > '95 %' or input.estop\"": "input.battery 90 of 95 %",
    "after: \"input.battery < '20 %'\", eventually: \"input.battery > '3 %'\", within: 2 s": None,
    "after: \"input.battery < '20 %'\", eventually: \"input.battery > '30 %'\", within: 2 s": (
        "after 1 of 2 s"
    ),
    "after: input.estop, eventually: \"input.battery > '30 %'\", within: 2 s": None,
}


@pytest.mark.parametrize("says", SAYS)
def test_the_nearest_is_kept(tmp_path: Path, says: str) -> None:
    """None where nothing else of the breach was true, or nothing was due."""
    robot = Robot(chart_with(tmp_path, says))
    robot.engine.watch = monitor = MarginMonitor(robot.engine.machine.chart)
    robot.engine.start()
    robot.sees("battery", 0.5, 0.5)
    monitor.breaches.clear()
    monitor.margins.clear()  # before anything was reported it counts as charged
    for at, charge in CHARGED:
        robot.sees("battery", charge, at)
    assert {name: str(one) for name, one in monitor.margins.items()} == (
        {} if SAYS[says] is None else {"charged": SAYS[says]}
    )
    assert monitor.breaches == []


def test_a_breach_leaves_nothing(tmp_path: Path) -> None:
    """What is left is below zero then."""
    robot = Robot(chart_with(tmp_path, "never: \"input.battery < '15 %'\""))
    robot.engine.watch = monitor = MarginMonitor(robot.engine.machine.chart)
    robot.engine.start()
    robot.sees("battery", 0.12, 1.0)
    assert monitor.margins["charged"].left == pytest.approx(-3.0)
    assert monitor.breaches == ["charged"]
