"""The command itself: help, unknown verbs, exit codes, crash logs."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from lupin_cli import crash
from lupin_cli import main as entry
from lupin_cli.main import OPERATOR_VERBS, VERBS, lupin, main
from lupin_engine.errors import ChartError, Diagnostic, LupinError, Place, UsageError
from tests.processes import ended

HEAVY = ("numpy", "pydantic", "rich", "structlog", "transitions", "yaml", "rclpy", "lupin_engine.chart")

ALL_VERBS = {**VERBS, **OPERATOR_VERBS}
#: Those of the greenhouse's requests.
REQUESTS = ("abort", "dock", "pause", "reset", "resume", "skip")


def test_help_imports_nothing_heavy() -> None:
    """It must answer at once; each of these would cost more than all the rest."""
    program = (
        "import sys; from lupin_cli.main import main; main(['--help']); "
        f"print('HEAVY', sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    assert output.splitlines()[-1] == "HEAVY []"
    assert all(f"  {verb} " in output for verb in (*ALL_VERBS, *REQUESTS))
    assert "\nOperator:\n  start " in output


def test_the_help_of_a_verb_imports_nothing_heavy() -> None:
    """What a verb works with is imported when it works."""
    program = (
        "import sys; from lupin_cli.main import OPERATOR_VERBS, VERBS, main\n"
        f"for verb in (*VERBS, *OPERATOR_VERBS, *{REQUESTS}):\n"
        "    code = main([verb, '--help'])\n"
        f"    print('HEAVY', verb, code, sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    said = [line for line in output.splitlines() if line.startswith("HEAVY")]
    assert said == [f"HEAVY {verb} 0 []" for verb in (*ALL_VERBS, *REQUESTS)]
    assert all(f"Usage: lupin {verb} " in output for verb in (*ALL_VERBS, *REQUESTS))


@pytest.mark.parametrize("verb", ALL_VERBS)
def test_the_table_says_what_the_verb_says(verb: str) -> None:
    """The one-line help stands in two places, so that the list needs no import."""
    command = lupin.get_command(click.Context(lupin), verb)
    assert command is not None
    assert ALL_VERBS[verb].removesuffix(".") == command.get_short_help_str(limit=200).removesuffix(".")


def test_an_unknown_verb_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, on standard error."""
    assert main(["chek"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "Error: unknown command 'chek'; did you mean 'check'?"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--seeds", "0"], ["Invalid value for '--seeds': 0 is not in the range x>=1."]),
        (
            ["--seeds", "0", "--min-coverage", "x"],
            [
                "Invalid value for '--seeds': 0 is not in the range x>=1.",
                "Invalid value for '--min-coverage': 'x' is not a valid float range.",
            ],
        ),
    ],
)
def test_all_values_that_a_verb_refuses_are_told(
    arguments: list[str], told: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """At once, each on a line."""
    assert main(["test", *arguments]) == 2
    assert capsys.readouterr().err.splitlines()[3:] == [f"Error: {line}" for line in told]


def test_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    """What a report needs first."""
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("lupin, version ")


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Have a verb `lupin fails`, which `fail_with` makes."""
    monkeypatch.setattr(entry, "VERBS", {**VERBS, "fails": "Fails."})
    return monkeypatch


def fail_with(patch: pytest.MonkeyPatch, problem: BaseException) -> None:
    @click.command()
    def fails() -> None:
        raise problem

    patch.setattr(entry.Verbs, "get_command", lambda self, ctx, name: fails)


PLACE = Place("a.yaml", 3, 5)


@pytest.mark.parametrize(
    ("problem", "code", "text"),
    [
        (LupinError("no map"), 1, "lupin: no map\n"),
        (UsageError("no mission 'x'"), 2, "lupin: no mission 'x'\n"),
        (ChartError([Diagnostic(PLACE, "r", "p", "bad")]), 1, "a.yaml:3:5: error: p: bad [r]\n"),
        (KeyboardInterrupt(), 130, "\n"),
    ],
    ids=["failure", "usage", "findings", "interrupt"],
)
def test_failures_become_text_and_exit_code(
    verb: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    problem: BaseException,
    code: int,
    text: str,
) -> None:
    """Never a traceback; findings begin with their place, so that editors can jump there."""
    fail_with(verb, problem)
    assert main(["fails"]) == code
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", text)


def test_a_defect_is_written_down(
    verb: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """One line for the user, the traceback and the versions in a file that can be sent."""
    verb.setenv("XDG_STATE_HOME", str(tmp_path))
    fail_with(verb, ZeroDivisionError("by zero"))
    assert main(["fails"]) == 70
    first, second = capsys.readouterr().err.splitlines()
    assert first == "lupin: a defect of the engine: ZeroDivisionError: by zero"
    log = Path(second.removeprefix("lupin: please report "))
    assert log.is_relative_to(tmp_path)
    text = log.read_text()
    assert "Traceback (most recent call last)" in text
    assert "lupin-engine " in text
    assert "ZeroDivisionError: by zero" in text


def test_a_defect_that_cannot_be_written_down_is_told(
    verb: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A full disk, say; exit code and first line are the same."""

    def full(_: BaseException) -> Path:
        raise OSError(28, "No space left on device")

    verb.setenv("XDG_STATE_HOME", str(tmp_path))
    verb.setattr(crash, "write_crash_log", full)
    fail_with(verb, ZeroDivisionError("by zero"))
    assert main(["fails"]) == 70
    assert capsys.readouterr().err.splitlines() == [
        "lupin: a defect of the engine: ZeroDivisionError: by zero",
        "lupin: nothing more could be written down: [Errno 28] No space left on device",
    ]


def test_old_crash_logs_make_room(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A verb that fails in a loop does not fill the disk."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = tmp_path / "lupin" / "crashes"
    folder.mkdir(parents=True)
    for number in range(30):
        (folder / f"2000-01-01_00-00-{number:02d}_{os.getpid()}.log").touch()
    newest = crash.write_crash_log(ZeroDivisionError("by zero"))
    left = sorted(folder.iterdir())
    assert len(left) == 20
    assert left[-1] == newest


def test_a_reader_that_leaves_is_no_defect() -> None:
    """`lupin node | head -1`: no traceback, no crash log."""
    program = "import sys; from lupin_cli.main import main; sys.stdin.read(); sys.exit(main(['--help']))"
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with ended(subprocess.Popen([sys.executable, "-c", program], **pipes)) as process:
        assert process.stdin
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        process.stdin.close()
        assert process.stderr.read() == b""
        assert process.wait(30) == 141


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_was_closed_is_no_defect(closed: str) -> None:
    """A daemon may start us without standard input or output: nothing is read, or told, there."""
    command = f"{shlex.quote(sys.executable)} -m lupin_cli.main plugin list {closed}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert ("greenhouse" in done.stdout) is (">&-" not in closed.replace("2>&-", ""))
