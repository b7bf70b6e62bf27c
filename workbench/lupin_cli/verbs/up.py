"""`lupin up`: starts the nodes of missions, and leaves starting a mission to the operator."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_engine.errors import LupinError, Severity
from lupin_engine.plugin import Catalog, load_catalog, robot_namespace
from lupin_ros.launch import current_domain

if TYPE_CHECKING:
    from lupin_cli.bring_up import CheckedOptions
    from lupin_engine.missions import LoadedMissions
    from lupin_engine.plugin import Profile, Progress
    from lupin_ros.launch import Bringup, Observer


@click.command(short_help="Start the nodes of missions; an operator starts the missions.")
@click.argument("missions", nargs=-1)
@options.bring_up
@not_done()
def up(missions: tuple[str, ...], **wanted: Any) -> int:
    """Start the nodes of missions; an operator starts the missions.

    MISSIONS are names or files; without any, all missions of the folder. Ctrl-C stops what was started.

    Exit code: 0 ended by Ctrl-C, 2 not started, or ended by an error.
    """
    from lupin_cli.bring_up import CheckedOptions, GivenOptions
    from lupin_cli.terminal.observers import Heard, PlainObserver
    from lupin_engine.missions import load_missions
    from lupin_engine.runtime import make_world
    from lupin_ros.launch import Interrupts

    loaded = load_missions(missions, load_catalog(), reaching=True)
    catalog = loaded.chart.catalog
    given = CheckedOptions(GivenOptions(**wanted), loaded, catalog)
    with given.problems.collecting():
        make_world(loaded.chart, given.values)
    settings = replace(given.settings(), stays_in_fault=True)
    from lupin_ros.launch import Bringup  # needs rclpy

    with Interrupts() as interrupts:
        observer = Heard(PlainObserver(), interrupts.stop)
        with Bringup(settings, observer, interrupts) as bringup:
            return _serve(bringup, observer, given, loaded, catalog)


def _serve(
    bringup: Bringup, observer: Observer, given: CheckedOptions, loaded: LoadedMissions, catalog: Catalog
) -> int:
    from lupin_ros.launch import NOT_DONE, Interrupted

    try:
        bringup.bring_up(given.plugins, catalog, loaded.heard)
        for line in given.addresses(bringup.description.launches):
            observer.note(line)
        observer.note("\n".join(served(loaded, current_domain(), robot_namespace())))
        bringup.watch(_StateLines(observer, loaded.chart.profile))
    except Interrupted:
        return 0  # the way to end it
    except LupinError as problem:
        observer.note(str(problem), Severity.ERROR)
    return NOT_DONE


class _StateLines:
    """Writes a line when the published state is another one."""

    def __init__(self, observer: Observer, profile: Profile) -> None:
        self._observer = observer
        self._profile = profile
        self._last: tuple[Any, ...] = ()

    def __call__(self, progress: Progress) -> None:
        from lupin_cli.terminal import view

        if progress.lifecycle and (key := view.changed_key(progress)) != self._last:
            self._last = key
            self._observer.note(view.plain_state(progress, self._profile))


def served(loaded: LoadedMissions, domain: int, robot: str = "") -> list[str]:
    """Return lines for an operator: the commands that start each mission, and the other requests."""
    # Which a shell of its own does not know.
    option = (f" --domain {domain}" if domain else "") + (f" --robot {robot[1:]}" if robot else "")
    start = [f"  lupin start {file.stem}{option}" for file in loaded.files]
    verbs = ", ".join(["state", "answer", *loaded.chart.profile.verbs.values()])
    return [
        f"ready in ROS domain {domain}{robot and f', robot {robot}'}; start a mission from the HMI, or with",
        *start,
        f"and operate it with lupin {verbs}{f'; all of them with{option}' if option else ''}",
        "Ctrl-C stops everything",
    ]
