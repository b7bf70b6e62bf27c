"""Codes and their severities: what the operator is told, and how loudly. No ROS."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lupin_engine.errors import Severity
from lupin_engine.plugin.contract import Code, classify

CODES = {
    "battery_low": Code("battery_low", "battery low", Severity.WARN),
    "localization_failed": Code("localization_failed", "localization failed", Severity.ERROR),
}


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("", ("", 0)),
        ("battery_low", ("battery low", 1)),
        ("made_up", ("made_up", 1)),
        ("execution_error", ("an expression or an action failed", 2)),
    ],
)
def test_a_code_is_classified_as_declared(code: str, expected: tuple[str, int]) -> None:
    found = classify(code, CODES)
    assert (found.label, found.severity) == expected


def test_codes_are_classified_without_ros() -> None:
    """Also the fields of MissionState are made where there are no interfaces."""
    told = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; from lupin_engine.plugin.contract import classify; import lupin_greenhouse.messages;"
            "print(classify('x', {}).label, [m for m in sys.modules if 'rclpy' in m or '_msgs' in m])",
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert told.stdout == "x []\n"
