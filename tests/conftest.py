"""How tests run: the longest first, and properties with the same few examples each time.

So a failure of a property can be repeated, and comes with the change that causes it.
`--hypothesis-profile=search` looks for others, at random and for long.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

_SLOW = {"deadline": None, "suppress_health_check": [*settings().suppress_health_check, HealthCheck.too_slow]}
settings.register_profile("suite", **_SLOW, max_examples=40, derandomize=True)
settings.register_profile("search", **_SLOW, max_examples=2_000, derandomize=False)
settings.load_profile("suite")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that may take longest, by their timeout: else workers wait for the last one."""
    lost = [
        item.nodeid
        for item in items
        if item.get_closest_marker("browser") and "console" not in item.path.parts
    ]
    assert not lost, f"tools/suite.py looks for tests in a browser in folders called console only: {lost}"
    items.sort(key=lambda item: -max((mark.args[0] for mark in item.iter_markers("timeout")), default=0.0))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show why a test was tried again: such a failure is a defect to look for."""
    for report in terminalreporter.stats.get("rerun", []):
        terminalreporter.write_sep("_", f"first try of {report.nodeid}")
        terminalreporter.write_line(report.longreprtext)


#: Workers of pytest-xdist are told a width, and what the verbs print would be folded by it.
os.environ.pop("COLUMNS", None)
