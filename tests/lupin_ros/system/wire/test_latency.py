"""The benchmark of the e-stop measures what it says: both nodes are stopped, and armed again."""

from __future__ import annotations

import pytest

from tests.benchmarking import started

pytestmark = pytest.mark.timeout(300)


def test_an_e_stop_is_a_cancel_on_the_wire_in_every_trial(ros_domain: int) -> None:
    """The figures of three trials say nothing of speed, but each of them has stopped a drive."""
    title, columns, *rows, ratio = started("estop_latency.py", "--trials", "3").stdout.splitlines()
    assert title.startswith("e-stop to cancel, ms; 3 trials each; load ")
    assert columns.split() == ["p50", "p99", "slowest"]
    assert [row[:24].strip() for row in rows] == ["mission_orchestrator", "bare rclpy node"]
    for row in rows:
        median, p99, slowest = map(float, row[24:].split())
        assert 0.0 < median <= p99 <= slowest
    assert ratio.startswith("ratio of the medians: ")
