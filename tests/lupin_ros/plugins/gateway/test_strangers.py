"""A crowd of strangers before the gateway: operators come in, STOP is told, and the log stays small."""

from __future__ import annotations

import re

import pytest

from tests.benchmarking import started

pytestmark = [pytest.mark.long, pytest.mark.timeout(300)]
pytest.importorskip("trustme")

#: Descriptors of the gateway: fewer than the crowd wants.
DESCRIPTORS = 350
FEW = ["--silent", "300", "--slow", "60", "--seconds", "2", "--descriptors", str(DESCRIPTORS)]


def test_a_crowd_shuts_nobody_out(ros_domain: int) -> None:
    """The benchmark with a small crowd and few descriptors: of one address, the operator's own, and 500."""
    done = started("strangers.py", *FEW)
    rows = re.findall(r"^(stop|in), (.+?) +(\d+) +([\d.]+) +([\d.]+) +([\d.]+)", done.stdout, re.MULTILINE)
    assert [crowd for kind, crowd, *_ in rows if kind == "in"] == [
        *("nobody", "one address", "the operator's address", "500 addresses"),
    ]
    for kind, _, _, middle, _, slowest in rows:
        assert float(middle) <= 50.0 if kind == "stop" else float(slowest) <= 2_000.0, done.stdout
    assert all(int(held) < DESCRIPTORS for held in re.findall(r"descriptors: (\d+)", done.stdout))
    log = done.stderr
    assert len(log.splitlines()) <= 5, log
    assert "connections were ended:" in log
