"""`lupin record`: records every topic into one file, until the mission ends or Ctrl-C."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_cli import options
from lupin_engine.errors import Problems, Severity, UsageError
from lupin_ros.launch import close_the_doors, current_place

if TYPE_CHECKING:
    from lupin_ros.launch import Interrupts
    from lupin_ros.recording import TopicRecorder

#: How long what a mission tells last may take after its end, in seconds.
_STRAGGLER_S = 2.0
#: Seconds between two looks at the recorder.
_TICK_S = 0.2


@click.command(short_help="Record every topic into a file for Foxglove, Lichtblick, rosbag2.")
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.mcap",
    help="The new file; default: lupin_TIME.mcap here.",
)
@click.option("--without", metavar="REGEX", help="Leave out topics in whose name this is found.")
@options.domain
def record(output: Path | None, without: str | None, domain: int | None) -> int:
    """Record every topic that a node publishes into one MCAP file.

    Ends with the mission that runs, or that comes next, and at Ctrl-C. Messages that publishers keep for late
    subscribers are in the file too. Topics of actions, which ROS hides, are left out.

    Exit code: 0 recorded; 1 the file ends too early, because the disk is full; 2 nothing was recorded.
    """
    from lupin_cli.recording import check_recording
    from lupin_ros.launch import prepare_ros

    path = output or Path(f"lupin_{time.strftime('%Y-%m-%d_%H-%M-%S')}.mcap")
    problems = Problems(UsageError)
    with problems.collecting():
        close_the_doors(domain)
    with problems.collecting():
        check_recording(path)
    with problems.collecting():
        pattern = _pattern(without)
    with problems.collecting():
        prepare_ros()
    problems.raise_any()
    return _record(path, pattern)


def _pattern(without: str | None) -> re.Pattern[str] | None:
    try:
        return re.compile(without) if without else None
    except re.error as problem:
        raise UsageError(f"--without: {without!r} is no regular expression: {problem}") from None


def _record(path: Path, without: re.Pattern[str] | None) -> int:
    from lupin_cli.recording import result
    from lupin_cli.terminal.tty import quiet_terminal
    from lupin_engine.plugin import load_profiles
    from lupin_ros.launch import Interrupts
    from lupin_ros.recording import TopicRecorder  # needs rclpy

    with quiet_terminal(), Interrupts() as interrupts:
        with TopicRecorder(path, without, load_profiles()) as recorder:
            click.echo(f"recording {current_place()} into {path}; Ctrl-C ends it")
            _watch(recorder, interrupts)
        _print_news(recorder)
        click.echo(result(recorder))
    if not recorder.messages:
        return 2
    return 1 if recorder.failed else 0


def _watch(recorder: TopicRecorder, interrupts: Interrupts) -> None:
    """Show the progress, on a terminal in a line that is written again and again."""
    from rich.console import Console
    from rich.live import Live

    from lupin_cli.recording import amount
    from lupin_cli.terminal.words import clock

    console, began = Console(highlight=False), time.monotonic()
    with Live(console=console, auto_refresh=False, transient=True) as line:
        while not (recorder.failed or interrupts.count or _is_over(recorder)):
            _print_news(recorder)
            if console.is_terminal:
                line.update(f"{clock(time.monotonic() - began)}  {amount(recorder)}", refresh=True)
            time.sleep(_TICK_S)


def _is_over(recorder: TopicRecorder) -> bool:
    over = recorder.mission_is_over
    return over is not None and time.monotonic() - over > _STRAGGLER_S


def _print_news(recorder: TopicRecorder) -> None:
    for text, severity in recorder.news():
        problem = severity is Severity.ERROR
        print(f"lupin: {text}" if problem else text, file=sys.stderr if problem else sys.stdout, flush=True)
