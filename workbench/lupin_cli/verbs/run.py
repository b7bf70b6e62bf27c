"""`lupin run`: starts the nodes of a mission over ROS 2, runs and follows it, and stops the nodes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import INTERRUPTED, not_done
from lupin_engine.errors import LupinError, Severity
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_cli.bring_up import CheckedOptions
    from lupin_cli.terminal.keys import Press
    from lupin_engine.missions import LoadedMissions
    from lupin_ros.launch import Bringup, Interrupts, RunMonitor


@click.command(cls=options.RequestCommand, short_help="Run a mission over ROS 2 and watch it.")
@click.argument("mission")
@options.fields
@options.bring_up
@click.option(
    "--patience",
    type=click.FloatRange(min=0.0),
    metavar="SECONDS",
    help="How long the mission may wait for an operator; "
    f"default: {options.PATIENCE_S:g}, on a terminal for ever.",
)
@click.option("--json", "as_json", is_flag=True, help="Write one JSON object a line.")
@click.option(
    "--save-svg",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Save a picture from the middle of the run.",
)
@click.option(
    "--record",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.mcap",
    help="Record every topic of the run into a new file.",
)
@not_done()
def run(
    mission: str,
    request: dict[str, Any],
    fields: tuple[str, ...],
    patience: float | None,
    as_json: bool,
    save_svg: Path | None,
    record: Path | None,
    **wanted: Any,
) -> int:
    """Run a mission over ROS 2 and watch it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. Its missing nodes
    are started; running ones are used and left alone. Ctrl-C aborts the mission, lets the robot drive home
    and ends everything that was started; a second one stops the robot on the way, a third one forces.

    Exit code: 0 all targets visited, 1 some missed, 2 fault or not started, 130 interrupted, or the reader
    of the output has ended.
    """
    from lupin_cli.bring_up import CheckedOptions, GivenOptions
    from lupin_cli.recording import check_recording, recorded
    from lupin_cli.requests import check_request
    from lupin_cli.run_folders import writable
    from lupin_cli.terminal.tty import quiet_terminal
    from lupin_engine.missions import load_missions
    from lupin_ros.launch import Interrupts

    loaded = load_missions([mission], load_catalog(), reaching=True)
    given = CheckedOptions(GivenOptions(**wanted), loaded, loaded.chart.catalog)
    with given.problems.collecting():
        request = check_request(loaded, given.values, request, fields)
    with given.problems.collecting():
        if save_svg is not None:
            writable(save_svg.parent, "picture")
    with given.problems.collecting():
        if record is not None:
            check_recording(record)
    if patience is None and (as_json or not sys.stdout.isatty()):
        patience = options.PATIENCE_S
    settings = given.settings(patience)
    from lupin_ros.launch import Bringup  # needs rclpy

    keys = not as_json and _is_live() and sys.stdin.isatty()
    with quiet_terminal(keys), Interrupts() as interrupts:
        display = _observer(as_json, save_svg, loaded, interrupts)
        with recorded(record, display) as observer, Bringup(settings, observer, interrupts) as bringup:
            start = partial(bringup.start, loaded.names[0], request, any_field=bool(fields))
            code = _carry_out(bringup, observer, given, loaded, start, keys)
        display.close(bringup.monitor, code)
    return code


def _carry_out(
    bringup: Bringup,
    observer: Any,
    given: CheckedOptions,
    loaded: LoadedMissions,
    start: Callable[[], RunMonitor],
    keys: bool,
) -> int:
    """Bring the nodes up, start the mission and follow it; return the exit code.

    An error is reported to the observer and aborts the mission.
    """
    from lupin_ros.launch import NOT_DONE, Interrupted

    try:
        bringup.bring_up(given.plugins, loaded.chart.catalog, loaded.heard)
        for line in given.addresses(bringup.description.launches):
            observer.note(line)
        monitor = start()
        bringup.follow(monitor, _hands(bringup, monitor, observer) if keys else lambda: None)
        return monitor.verdict
    except Interrupted:
        code = INTERRUPTED
    except LupinError as problem:
        observer.note(str(problem), Severity.ERROR)
        code = NOT_DONE
    if bringup.monitor is not None and not bringup.monitor.ended:
        bringup.abort(bringup.monitor)
    return code


def _hands(bringup: Bringup, monitor: RunMonitor, observer: Any) -> Callable[[], None]:
    """Return a function that reads keys, sends their commands, and shows the answers."""
    from lupin_cli.terminal.keys import Keypad, typed

    pad = Keypad(monitor.profile)
    observer.note(pad.help)
    typed()  # what was pressed before there was a mission was not meant for it

    def look() -> None:
        for key in typed():
            pressed = pad.press(key, monitor.asking(time.monotonic()), time.monotonic())
            if pressed is None:
                continue
            severity, text = Severity.INFO, pressed.text
            if pressed.verb:
                accepted, said = _commanded(bringup, pressed)
                severity, text = (Severity.INFO if accepted else Severity.WARN), f"{text}: {said}"
            monitor.note(time.monotonic(), severity, text)

    return look


def _commanded(bringup: Bringup, pressed: Press) -> tuple[bool, str]:
    """Send the command of a key; a failure is shown, and does not end the run."""
    try:
        answer = bringup.command(pressed.verb, pressed.request)
    except LupinError as problem:
        return False, str(problem)
    return answer.accepted, answer.text


def _is_live() -> bool:
    """Return whether the live picture of a run can be drawn."""
    from rich.console import Console

    console = Console()
    return console.is_terminal and not console.is_dumb_terminal


def _observer(as_json: bool, save_svg: Path | None, loaded: LoadedMissions, interrupts: Interrupts) -> Any:
    from rich.console import Console

    from lupin_cli.terminal.observers import (
        Heard,
        JsonObserver,
        LiveObserver,
        PlainObserver,
        SavingPicture,
    )

    observer: Any
    console = Console(highlight=False)
    if as_json:
        observer = JsonObserver()
    elif _is_live():
        observer = LiveObserver(console, loaded.chart)
    else:
        observer = PlainObserver()
    observer = Heard(observer, interrupts.stop)
    return SavingPicture(observer, loaded.chart, save_svg) if save_svg else observer
