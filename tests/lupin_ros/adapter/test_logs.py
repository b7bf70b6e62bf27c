"""Lines of the log: bounded, whatever somebody else put into them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, cast

import pytest

from lupin_ros.adapter.logs import COUNT_S, MAX_LINE, MOST, NodeLog, _as_line


def test_a_line_has_an_end() -> None:
    line = _as_line(None, "info", {"event": "request", "by": "x" * 100_000})
    assert line == ("request (by='" + "x" * MAX_LINE)[:MAX_LINE] + "..."
    assert _as_line(None, "info", {"event": "request", "by": "me"}) == "request (by='me')"


def test_a_traceback_is_whole() -> None:
    trace = "line\n" * MAX_LINE
    assert _as_line(None, "error", {"event": "failed", "exception": trace}) == f"failed\n{trace}"


class FakeNode:
    """A node whose logger keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.now = 0.0

    def get_logger(self) -> Any:
        return self

    def info(self, line: str) -> None:
        self.lines.append(line)

    warning = error = info


@pytest.fixture
def node() -> FakeNode:
    return FakeNode()


def book_of(node: FakeNode) -> NodeLog:
    return NodeLog(cast(Any, node), lambda: node.now)


def test_equal_lines_are_counted(node: FakeNode) -> None:
    """Told once in ten seconds, then how many there were; with other details it is another line."""
    book = book_of(node)
    for _ in range(38):
        book.log.info("request", request="operator.pause", answer="refused")
    book.log.info("request", request="operator.abort", answer="refused")
    book.log.warning("request", request="operator.pause", answer="refused")
    assert node.lines == [
        "request (request='operator.pause' answer='refused')",
        "request (request='operator.abort' answer='refused')",
        "request (request='operator.pause' answer='refused')",
    ]
    node.lines.clear()
    node.now = COUNT_S - 0.1
    book.flush()
    assert node.lines == []
    node.now = COUNT_S
    book.flush()
    assert node.lines == ["request: 37 times more in 10 s"]
    book.log.info("request", request="operator.pause", answer="refused")
    assert node.lines[1:] == ["request (request='operator.pause' answer='refused')"]


def test_the_count_comes_before_the_next_line(node: FakeNode) -> None:
    """Also when nobody has looked meanwhile; and at the end."""
    book = book_of(node)
    book.log.info("again")
    book.log.info("again")
    node.now = 12.0
    book.log.info("again")
    book.log.info("again")
    node.now = 13.5
    book.close()
    assert node.lines == ["again", "again: 1 times more in 12 s", "again", "again: 1 times more in 2 s"]


def test_commands_with_other_ids_are_the_same_line(node: FakeNode) -> None:
    book = book_of(node)
    for number in range(1000):
        book.log.info("request", answer="refused", command_id=str(number), by="ann")
    assert node.lines == ["request (answer='refused' command_id='0' by='ann')"]


def test_what_differs_all_the_time_ends_as_well(node: FakeNode) -> None:
    """So many of one text, and so many texts."""
    book = book_of(node)
    for number in range(5 * MOST):
        book.log.info("passed over", what=number)
    assert len(node.lines) == MOST
    for number in range(5 * MOST):
        book.log.info(f"note {number}")
    assert len(book._counted) == MOST


def test_the_file_has_records_and_does_not_grow_for_ever(node: FakeNode, tmp_path: Path) -> None:
    """With what is under way; the oldest are gone."""
    book, file = book_of(node), tmp_path / "log" / "node.jsonl"
    book.write_to(file, 2000, 2)
    book.about = {"mission_id": "lupin-1", "target": "5", "step": 7}
    book.log.info("request", request="operator.pause", by="x" * 9000)
    (line,) = file.read_text(encoding="utf-8").splitlines()
    record = json.loads(line)
    assert re.fullmatch(r"20\d\d-\d\d-\d\dT[\d:.]+Z", record.pop("time"))
    assert len(record.pop("by")) == MAX_LINE + 3
    about = {"mission_id": "lupin-1", "target": "5", "step": 7}
    assert record == {"event": "request", "level": "info", "request": "operator.pause", **about}
    for number in range(200):
        node.now += COUNT_S
        book.log.warning("passed over", what=number, target="12")
    book.close()
    found = sorted(tmp_path.glob("log/*"))
    assert [each.name for each in found] == ["node.jsonl", "node.jsonl.1", "node.jsonl.2"]
    assert all(each.stat().st_size <= 2000 for each in found)
    last = json.loads(file.read_text(encoding="utf-8").splitlines()[-1])
    assert (last["what"], last["target"], last["step"], last["level"]) == (199, "12", 7, "warning")


def test_a_file_that_cannot_be_written_changes_nothing(
    node: FakeNode, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    book = book_of(node)
    book.write_to(tmp_path, 2000, 2)  # a folder
    book.log.info("on the console")
    assert node.lines == ["on the console"]
    assert capfd.readouterr().err == ""
