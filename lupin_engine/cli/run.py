"""`lupin run`: a mission over ROS 2 with everything that it needs, watched, and everything stopped again."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_engine.cli.settings import read_settings
from lupin_engine.errors import LupinError, Severity
from lupin_engine.launch.environment import HIGHEST_DOMAIN, close_the_doors, for_children
from lupin_engine.launch.folders import new_run_folder
from lupin_engine.launch.interrupts import Interrupted, Interrupts
from lupin_engine.launch.mission import Loaded, check_request, load_missions
from lupin_engine.launch.nodes import ORCHESTRATOR
from lupin_engine.launch.plan import Values, simulators
from lupin_engine.launch.requirements import prepare_ros
from lupin_engine.launch.story import INTERRUPTED, NOT_DONE
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.registry import Catalog, load_catalog

if TYPE_CHECKING:
    from lupin_engine.launch.session import Session

#: How long a mission may wait for an operator when nobody watches a terminal, in seconds.
PATIENCE_S = 60.0


@dataclass(frozen=True)
class Options:
    """What the command line asks for, read but not yet checked."""

    mission: str
    settings: tuple[str, ...]
    sim: tuple[str, ...]
    tags: tuple[str, ...]
    goal: int
    speed: float
    domain: int | None
    json: bool
    log_dir: Path | None
    no_sim: bool
    patience: float | None
    save_svg: Path | None


def _tags(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


@click.command(short_help="Run a mission over ROS 2 and watch it.")
@click.argument("mission")
@click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter, such as nav_timeout_s='90 s'.",
)
@click.option(
    "--tags", metavar="1,5,12", callback=_tags, help="The tags to visit; default: the mission's own."
)
@click.option("--goal", type=click.IntRange(min=0, max=65535), default=0, help="How many tags to discover.")
@click.option(
    "--speed",
    type=click.FloatRange(min=0.02, max=20.0),
    default=1.0,
    help="Times as fast as the simulated robot drives.",
)
@click.option(
    "--sim",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the simulated robot, such as battery=0.1.",
)
@click.option("--no-sim", is_flag=True, help="Start no simulated robot: wait for the real one.")
@click.option(
    "--domain",
    type=click.IntRange(min=0, max=HIGHEST_DOMAIN),
    help="ROS domain; default: ROS_DOMAIN_ID, else 0.",
)
@click.option("--json", "as_json", is_flag=True, help="Write one JSON object a line.")
@click.option(
    "--log-dir", type=click.Path(file_okay=False, path_type=Path), help="Folder for the nodes' logs."
)
@click.option(
    "--patience",
    type=click.FloatRange(min=0.0),
    metavar="SECONDS",
    help="Give up when the mission waits for an operator so long; default: 60 off a terminal, else never.",
)
@click.option(
    "--save-svg",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Save a picture from the middle of the run.",
)
def run(as_json: bool, **given: Any) -> int:
    """Run a mission over ROS 2 and watch it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. What is missing of its nodes
    is started, what runs already is used and left alone. Ctrl-C aborts the mission, stops the robot and ends
    everything that was started; a second one forces.

    Exit code: 0 all targets visited, 1 some missed, 2 fault or start refused, 130 interrupted.
    """
    return _run(Options(json=as_json, **given))


def _run(options: Options) -> int:
    catalog = load_catalog()
    loaded = load_missions([options.mission], catalog)
    values = read_settings("--set", options.settings, loaded.chart.parameters)
    check_request(loaded, catalog, values, options.tags, options.goal)
    close_the_doors(options.domain)
    prepare_ros()
    from lupin_engine.launch.session import Session, Settings  # needs rclpy

    folder = new_run_folder(options.log_dir)
    settings = Settings(
        folder=folder,
        environment=for_children(folder),
        parameters=_parameters(options, loaded, catalog, values),
        insisted=_insisted(options, catalog),
        simulate=not options.no_sim,
        settle=bool(options.sim),
        patience=_patience(options),
    )
    observer = _observer(options, loaded)
    with Interrupts() as interrupts, Session(settings, observer, interrupts) as session:
        code = _carry_out(session, options, loaded, catalog, observer)
    observer.close(session.story, code)
    return code


def _carry_out(session: Session, options: Options, loaded: Loaded, catalog: Catalog, observer: Any) -> int:
    """Run the mission; whatever goes wrong, it is told here and the mission is aborted."""
    try:
        session.bring_up(loaded.chart.plugins, catalog)
        story = session.start(loaded.names[0], options.tags, options.goal)
        session.follow(story)
        return story.verdict
    except Interrupted:
        code = INTERRUPTED
    except LupinError as problem:
        observer.note(str(problem), Severity.ERROR)
        code = NOT_DONE
    if session.story is not None and not session.story.ended:
        session.abort(session.story)
    return code


def _parameters(
    options: Options, loaded: Loaded, catalog: Catalog, values: Mapping[str, Any]
) -> dict[str, Values]:
    """Return the parameters of the nodes: the mission's for the orchestrator, --sim for the robot."""
    found: dict[str, Values] = {ORCHESTRATOR: {**loaded.parameters(), **values}}
    for name, node in simulators(catalog).items():
        declared = node.parameters()
        given = read_settings("--sim", options.sim, declared)
        shared = {shared: value for shared, value in values.items() if shared in declared}
        found[name] = {**shared, **_faster(options.speed, declared), **given}
    return found


def _faster(speed: float, declared: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return the speed of a simulated robot that is so many times as fast as usual."""
    spec = declared.get("speed")
    return {"speed": spec.default * speed} if spec is not None and speed != 1.0 else {}


def _insisted(options: Options, catalog: Catalog) -> dict[str, str]:
    """Name the nodes that must be ours, because an option sets something of theirs, with that option."""
    found = {ORCHESTRATOR: "--set"} if options.settings else {}
    if options.sim or options.speed != 1.0:
        found.update(dict.fromkeys(simulators(catalog), "--sim" if options.sim else "--speed"))
    return found


def _patience(options: Options) -> float | None:
    if options.patience is not None:
        return options.patience
    return None if sys.stdout.isatty() and not options.json else PATIENCE_S


def _observer(options: Options, loaded: Loaded) -> Any:
    from rich.console import Console

    from lupin_engine.cli.observers import JsonObserver, LiveObserver, PlainObserver, SavingPicture

    observer: Any
    console = Console(highlight=False)
    if options.json:
        observer = JsonObserver()
    elif console.is_terminal and not console.is_dumb_terminal:
        observer = LiveObserver(console, loaded.chart)
    else:
        observer = PlainObserver()
    return SavingPicture(observer, loaded.chart, options.save_svg) if options.save_svg else observer
