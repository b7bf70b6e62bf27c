"""The supervisor with small Python programs as children; nothing of ROS."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_ros.adapter import process
from lupin_ros.launch.supervisor import Patience, Supervisor, cut_log, group_lives, last_lines
from tests.lupin_ros.launch.processes import until
from tests.processes import ended

#: A child that tells when it is there, and lives until it is told to end.
LIVES = "import signal; print('up', flush=True); signal.pause()"
#: One that ignores what it is told.
IGNORES = """
import signal
for number in (2, 15):
    signal.signal(number, signal.SIG_IGN)
print('up', flush=True)
signal.pause()
"""
#: One that ends at SIGINT and leaves a child of its own in the group, which does not.
LEAVES_ONE = (
    "import signal, subprocess, sys\n"
    f"subprocess.Popen([sys.executable, '-c', {IGNORES!r}])\n"
    "signal.signal(2, signal.SIG_DFL)\n"
    "signal.pause()"
)
QUICK = Patience(interrupt=0.3, terminate=0.3, kill=10.0)


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[Supervisor]:
    """A supervisor whose children end with the test."""
    with Supervisor(tmp_path, dict(os.environ)) as supervisor:
        yield supervisor


def start(supervisor: Supervisor, name: str, program: str, waits_for: str = "up") -> int:
    pid = supervisor.start(name, [sys.executable, "-c", program])
    log = supervisor.folder / f"{name}.log"
    until(lambda: waits_for in log.read_text(), f"{name} is up", 20.0)
    return pid


def test_children_are_stopped_by_an_interrupt(supervisor: Supervisor) -> None:
    """A child that listens needs no more than SIGINT, and its group is gone."""
    pid = start(supervisor, "one", LIVES)
    assert supervisor.names == ["one"]
    assert supervisor.stop() == []
    assert not group_lives(pid)
    assert supervisor.names == []


def test_a_child_that_ignores_signals_is_killed_and_named(supervisor: Supervisor) -> None:
    """SIGINT, SIGTERM, then SIGKILL; who had to be killed is told."""
    pid = start(supervisor, "deaf", IGNORES)
    start(supervisor, "good", LIVES)
    assert supervisor.stop(QUICK) == ["deaf"]
    assert not group_lives(pid)


def test_what_a_child_leaves_in_its_group_is_stopped_too(supervisor: Supervisor) -> None:
    """It is the group that must be gone, not only its leader."""
    pid = start(supervisor, "parent", LEAVES_ONE)
    assert supervisor.stop(QUICK) == ["parent"]
    until(lambda: not group_lives(pid), "the grandchild is gone", 10.0)


def test_the_patience_is_asked_again_while_waiting(supervisor: Supervisor) -> None:
    """A second Ctrl-C shortens a wait that has begun."""
    start(supervisor, "deaf", IGNORES)
    asked: list[int] = []

    def patience() -> Patience:
        asked.append(1)
        return QUICK if len(asked) > 3 else Patience(interrupt=1000.0)

    assert supervisor.stop(patience) == ["deaf"]


def test_a_death_is_told_once_with_the_last_lines(supervisor: Supervisor) -> None:
    """The exit code, the log, and what the program said before."""
    supervisor.start(
        "bad", [sys.executable, "-c", "print('first'); print('no such map'); raise SystemExit(3)"]
    )
    deaths = []
    until(lambda: deaths.extend(supervisor.deaths()) or deaths, "the death is noticed", 20.0)
    (death,) = deaths
    assert str(death) == f"bad ended with exit code 3; its log is {supervisor.folder / 'bad.log'}"
    assert death.text.splitlines()[1:] == ["  | first", "  | no such map"]
    assert supervisor.deaths() == []


def test_who_has_died_is_started_again_as_before(supervisor: Supervisor) -> None:
    """With the same command, its log going on; and its next death is told again."""
    first = start(supervisor, "one", LIVES)
    os.kill(first, signal.SIGKILL)
    until(supervisor.deaths, "the death is noticed", 20.0)
    second = supervisor.start_again("one")
    log = supervisor.folder / "one.log"
    until(lambda: log.read_text() == "up\nup\n", "it is up again", 20.0)
    assert (supervisor.names, second != first) == (["one"], True)
    os.kill(second, signal.SIGKILL)
    until(supervisor.deaths, "the second death is noticed", 20.0)
    assert supervisor.names == []


def test_who_was_started_again_is_stopped_in_its_old_turn(supervisor: Supervisor) -> None:
    """The orchestrator, which was started last, ends before the servers at which it cancels its goals."""
    tells = "import signal, time; print('up', flush=True); signal.sigwait([2]); print(time.monotonic())"
    blocked = f"import signal; signal.pthread_sigmask(signal.SIG_BLOCK, [2]); {tells}"
    first = start(supervisor, "server", blocked)
    start(supervisor, "orchestrator", blocked)
    os.kill(first, signal.SIGKILL)
    until(supervisor.deaths, "the death is noticed", 20.0)
    supervisor.start_again("server")
    until(lambda: (supervisor.folder / "server.log").read_text() == "up\nup\n", "it is up again", 20.0)
    assert supervisor.names == ["server", "orchestrator"]
    assert supervisor.stop() == []
    ends = [float(last_lines(supervisor.folder / f"{name}.log")[-1]) for name in ("orchestrator", "server")]
    assert ends == sorted(ends)


def test_a_signal_is_told_by_its_name(supervisor: Supervisor) -> None:
    """Who killed a node is the first thing that one wants to know."""
    os.kill(start(supervisor, "one", LIVES), signal.SIGKILL)
    deaths = []
    until(lambda: deaths.extend(supervisor.deaths()) or deaths, "the death is noticed", 20.0)
    assert deaths[0].how == "was killed by SIGKILL"


def test_children_get_the_environment_and_the_lifeline(tmp_path: Path) -> None:
    """What the supervisor was given, and the mark by which a child knows that it is supervised."""
    program = "import os; print(os.environ['A'], os.environ['LUPIN_SUPERVISED'], flush=True); os.read(0, 1)"
    with Supervisor(tmp_path, {**os.environ, "A": "b"}) as supervisor:
        start(supervisor, "one", program, "b 1")


def test_a_child_ends_when_its_supervisor_is_killed(tmp_path: Path) -> None:
    """`kill -9` of the supervisor closes the lifeline, however that happens."""
    child = (
        "import signal; from lupin_ros.adapter import process; process.end_with_supervisor(); "
        "print('up', flush=True); signal.pause()"
    )
    parent = (
        "import os, sys, signal, pathlib; from lupin_ros.launch.supervisor import Supervisor; "
        f"s = Supervisor(pathlib.Path({str(tmp_path)!r}), dict(os.environ)); "
        f"print(s.start('child', [sys.executable, '-c', {child!r}]), flush=True); signal.pause()"
    )
    command = [sys.executable, "-c", parent]
    with ended(subprocess.Popen(command, stdout=subprocess.PIPE, text=True)) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        log = tmp_path / "child.log"
        until(lambda: log.exists() and "up" in log.read_text(), "the child is up", 20.0)
        process.kill()
    until(lambda: not group_lives(pid), "the child has ended", 10.0)


def test_the_lifeline_ends_with_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the end of the file counts; and without a supervisor nobody listens."""
    reader, writer = os.pipe()
    os.write(writer, b"chatter")
    os.close(writer)
    ended: list[int] = []
    process.watch_descriptor(reader, lambda: ended.append(1))
    assert ended == [1]
    os.close(reader)
    monkeypatch.delenv(process.SUPERVISED, raising=False)
    assert process.end_with_supervisor() is None


def test_a_log_does_not_grow_for_ever(supervisor: Supervisor, tmp_path: Path) -> None:
    """The process goes on writing; what it wrote before is kept once."""
    supervisor.start("talker", ["sh", "-c", "echo first; read word; echo $word; sleep 60"])
    log = supervisor.folder / "talker.log"
    until(lambda: log.read_text() == "first\n", "the first word", 20.0)
    cut_log(log, 6)
    assert log.read_text() == "first\n"
    cut_log(log, 5)
    assert (log.read_text(), log.with_name("talker.log.1").read_text()) == ("", "first\n")
    (child,) = supervisor._children
    assert child.process.stdin is not None
    child.process.stdin.write(b"second\n")
    child.process.stdin.flush()
    until(lambda: log.read_text() == "second\n", "the second word", 20.0)


def test_the_last_lines_of_a_log(tmp_path: Path) -> None:
    """Empty lines say nothing; a log that is not there has no lines."""
    log = tmp_path / "a.log"
    log.write_text("\n".join(["one", "", "  two  ", "three", ""]))
    assert last_lines(log, 2) == ("  two", "three")
    assert last_lines(tmp_path / "absent") == ()
