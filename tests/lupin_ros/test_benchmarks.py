"""Benchmarks over ROS 2 run to their end and print what they say."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarking import started

pytestmark = pytest.mark.timeout(300)


@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("aggregator.py --seconds 1", "latency of an observation: median "),
        ("orchestrator.py abort --targets 20 --seconds 1", "aborted: answered in "),
        ("orchestrator.py flood --seconds 1", "requests a second, silent for "),
    ],
)
def test_a_benchmark_runs(line: str, printed: str) -> None:
    assert printed in started(*line.split()).stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("gateway.py --seconds 1 --stops 2", '"lost pages": 0'),
        ("idle_cpu.py --seconds 1 --rounds 1 --nodes mission_orchestrator", "| `mission_orchestrator` | "),
        ("recording.py --speed 20 --tags 1", "before compression: "),
        ("restarts.py kills --kills 1", "every target has one outcome"),
        ("soak.py --hours 0.0001 --every 1 --folder {}", "| mission_orchestrator | "),
    ],
)
def test_a_long_benchmark_runs(line: str, printed: str, tmp_path: Path) -> None:
    assert printed in started(*line.format(tmp_path / "soak").split()).stdout
