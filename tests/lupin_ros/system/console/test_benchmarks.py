"""Benchmarks of the console run to their end and print what they say."""

from __future__ import annotations

import shutil

import pytest

from tests.benchmarking import started

pytest.importorskip("playwright", reason="playwright is not installed here")

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(400),
    pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium is installed here"),
]

CONSOLE = "console.py --seconds 0.5 --profiles 1 --presses 2 --minutes 1 --compare 0.5 1"


@pytest.mark.parametrize(
    ("line", "printed"),
    [(CONSOLE, '"second half, least"'), ("chart_view.py --states 40 --seconds 1", "| idle: of one core | ")],
)
def test_a_benchmark_runs(line: str, printed: str) -> None:
    assert printed in started(*line.split(), timeout=380).stdout
