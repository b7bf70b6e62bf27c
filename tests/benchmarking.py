"""Starts benchmarks as their readers do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def started(script: str, *options: str, timeout: float = 280) -> subprocess.CompletedProcess[str]:
    """Run a benchmark to its end; with the smallest input its figures say nothing of speed."""
    command = [sys.executable, str(BENCHMARKS / script), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stdout + done.stderr
    return done
