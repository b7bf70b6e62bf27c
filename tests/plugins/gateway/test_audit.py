"""The audit log: a line for each command, in a private file, and nobody waits for the disk."""

from __future__ import annotations

import contextlib
import json
import os
import stat
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from lupin_gateway import audit
from lupin_gateway.audit import AuditLog, Repetitions, command_line
from tests.plugins.gateway.served import until

WHO = {"who": "anna", "role": "operator", "from": "10.0.0.7", "page": "anna-3"}
WALL = 1_790_000_000.25


def lines(file: Path) -> list[dict[str, Any]]:
    """What stands in a log."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def test_a_command_and_its_answer(tmp_path: Path) -> None:
    """Wall time, who, role, from where, what, the engine's answer, the step's number."""
    file = tmp_path / "logs" / "audit.jsonl"
    answer = {
        "accepted": True,
        "code": "",
        "message": "paused",
        "mission_id": "",
        "step": 17,
        "repeated": False,
    }
    log = AuditLog(file)
    log.write(command_line(WALL, WHO, "call_service", "/mission/pause", {"verb": "pause"}, answer))
    log.close()
    assert lines(file) == [
        {
            "wall": "2026-09-21T14:13:20.250+00:00",
            **WHO,
            "what": "call_service",
            "name": "/mission/pause",
            "sent": {"verb": "pause"},
            "accepted": True,
            "answer": "paused",
            "step": 17,
        }
    ]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ({"success": False, "message": "not running"}, {"accepted": False, "answer": "not running"}),
        ({"ok": True}, {"accepted": True, "answer": ""}),
        ({"accepted": True, "mission_id": "m1"}, {"accepted": True, "answer": "", "mission_id": "m1"}),
        ("not for viewers", {"accepted": False, "answer": "not for viewers"}),
        (None, {}),
        ({}, {"accepted": None, "answer": ""}),
    ],
)  # fmt: skip
def test_every_kind_of_answer(answer: Any, told: dict[str, Any]) -> None:
    """Of the interface document's services, of ours, of the doors, and none at all."""
    line = command_line(WALL, WHO, "call_service", "/x", {}, answer)
    assert {key: line[key] for key in line if key in ("accepted", "answer", "mission_id", "step")} == told


def test_long_arguments_are_cut() -> None:
    """A line stays a line that can be read."""
    line = command_line(WALL, WHO, "call_service", "/x", {"text": "a" * 100_000}, {"message": "b" * 100_000})
    assert line["sent"].endswith("… (100011 letters)")
    assert len(json.dumps(line)) < 5_000


def test_files_take_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full file becomes FILE.1, the one before it FILE.2; each is private."""
    monkeypatch.setattr(audit, "FILE_BYTES", 2_000)
    log = AuditLog(tmp_path / "audit.jsonl")
    for number in range(40):
        log.write({"number": number, "filled": "x" * 80})
    log.close()
    found = [
        one for name in ("audit.jsonl.2", "audit.jsonl.1", "audit.jsonl") for one in lines(tmp_path / name)
    ]
    assert [one["number"] for one in found] == list(range(40))
    assert {stat.S_IMODE(file.stat().st_mode) for file in tmp_path.iterdir()} == {0o600}


def test_a_disk_that_hangs_delays_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not fit is counted, and told when the disk is back."""
    monkeypatch.setattr(audit, "WAITING", 3)
    log, hangs, began = AuditLog(tmp_path / "audit.jsonl"), threading.Event(), threading.Event()
    write = log._handler.emit

    def slow(record: Any) -> None:
        began.set()
        assert hangs.wait(30)
        write(record)

    monkeypatch.setattr(log._handler, "emit", slow)
    log.write({"number": 0})
    assert began.wait(30)
    for number in range(1, 10):
        log.write({"number": number})
    hangs.set()
    while not log._waiting.empty():
        pass
    log.write({"number": 10, "wall": "now"})
    log.close()
    assert lines(tmp_path / "audit.jsonl") == [
        *({"number": number} for number in range(4)),
        {"wall": "now", "what": "lost", "lines": 6},
        {"number": 10, "wall": "now"},
    ]


def test_what_is_published_steadily_is_one_command() -> None:
    """Another message is another command, and so is the same one after a pause."""
    steady = Repetitions()
    still, drive = {"linear": {"x": 0.0}}, {"linear": {"x": 0.2}}
    assert steady.is_command("/cmd_vel", drive, 0.0)
    assert [steady.is_command("/cmd_vel", still, 0.05 * n) for n in range(1, 60)] == [True] + [False] * 58
    assert steady.is_command("/goal_pose", still, 3.0)
    assert steady.is_command("/cmd_vel", still, 10.0)


def deep(levels: int) -> Any:
    """A list in a list in a list."""
    nested: Any = []
    for _ in range(levels):
        nested = [nested]
    return nested


def test_what_is_nested_deep_has_a_line_too() -> None:
    """A frame may be nested deeper than what can be written."""
    assert command_line(WALL, WHO, "publish", "/x", deep(400), None)["sent"] == "nested too deep to be shown"
    steady = Repetitions()
    assert [steady.is_command("/x", deep(400), 0.1 * n) for n in range(2)] == [True, False]


def test_a_full_disk(tmp_path: Path) -> None:
    """It is told once, what is lost is counted, and the log goes on when there is room again."""
    file, told = tmp_path / "audit.jsonl", list[str]()
    log = AuditLog(file, told.append)
    disk = log._handler.stream
    log._handler.stream = Path("/dev/full").open("a", encoding="utf-8", buffering=1)  # noqa: SIM115
    for number in range(3):
        log.write({"number": number})
    until(lambda: told and not log._waiting.qsize(), "the disk refuses all")
    with log._handler.lock, contextlib.suppress(OSError):
        full, log._handler.stream = log._handler.stream, disk
        full.close()
    log.write({"number": 3})
    log.close()
    assert told == [f"{file}: the audit log cannot be written: [Errno 28] No space left on device"]
    *lost, last = lines(file)
    assert last == {"number": 3}
    assert lost in ([{"what": "lost", "lines": 3}], [{"what": "lost", "lines": 2}, {"number": 2}])


def test_a_log_that_cannot_be_written(tmp_path: Path) -> None:
    """The gateway runs all the same: without it there is no stop."""
    (tmp_path / "file").write_text("")
    told: list[str] = []
    log = AuditLog(tmp_path / "file" / "audit.jsonl", told.append)
    log.write({"number": 0})
    log.close()
    reason = f"[Errno 17] File exists: '{tmp_path}/file'"
    assert told == [f"{tmp_path}/file/audit.jsonl: the audit log cannot be written: {reason}"]


def test_a_disk_that_hangs_does_not_keep_the_gateway_from_ending(tmp_path: Path) -> None:
    """Not even where more lines wait than may."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    program = [
        "import sys, pathlib",
        "from lupin_gateway import audit",
        "audit.WAITING, audit.CLOSE_S = 2, 0.05",
        "log = audit.AuditLog(pathlib.Path(sys.argv[1]))",
        "[log.write({'filled': 'x' * 50_000}) for _ in range(10)]",  # a pipe holds 64 kB
        "log.close()",
    ]
    ended = subprocess.run([sys.executable, "-c", "\n".join(program), str(pipe)], timeout=30)
    os.close(reader)
    assert ended.returncode == 0
