"""Lines of the log: bounded, whatever somebody else put into them."""

from __future__ import annotations

from lupin_engine.ros.adapter.logs import MAX_LINE, _as_line


def test_a_line_has_an_end() -> None:
    line = _as_line(None, "info", {"event": "request", "by": "x" * 100_000})
    assert line == ("request (by='" + "x" * MAX_LINE)[:MAX_LINE] + "..."
    assert _as_line(None, "info", {"event": "request", "by": "me"}) == "request (by='me')"


def test_a_traceback_is_whole() -> None:
    trace = "line\n" * MAX_LINE
    assert _as_line(None, "error", {"event": "failed", "exception": trace}) == f"failed\n{trace}"
