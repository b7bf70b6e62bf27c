"""Defines the options that several verbs share, with those of the installed profiles' requests."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from lupin_cli.exit_codes import not_done
from lupin_engine.plugin import ROBOT, RequestField, load_profiles, read_domain, read_robot

_F = TypeVar("_F", bound=Callable[..., Any])

#: How long a mission may wait for an operator when nobody watches a terminal, in seconds.
PATIENCE_S = 60.0
#: Stands for the terminal where a file could be named.
TERMINAL = "-"
#: The option that gives any field of a request.
REQUEST = "--request"
#: What the file of a timeline ends in.
SVG, PNG = ".svg", ".png"


def _request_fields() -> dict[str, RequestField]:
    """Return the fields of requests that the installed profiles have options for."""
    fields = [pair for profile in load_profiles() for pair in profile.request.items()]
    return {name: field for name, field in fields if field.option}


def request_options() -> list[str]:
    """Return the options that fill requests."""
    return [*(field.option for field in _request_fields().values()), REQUEST]


class RequestCommand(click.Command):
    """A verb with options for a mission's request, given as `request`: by field, empty or 0 if not given."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the parameters, which depend on the installed plugins."""
        if __name__ not in ctx.meta:
            with not_done():
                fields = _request_fields()
            ctx.meta[__name__] = [_option(name, field) for name, field in fields.items()]
        return [*ctx.meta[__name__], *super().get_params(ctx)]

    def invoke(self, ctx: click.Context) -> Any:
        """Carry out the verb."""
        names = [option.name for option in ctx.meta[__name__]]
        ctx.params["request"] = {name: ctx.params.pop(name) for name in names}
        return super().invoke(ctx)


def _option(name: str, field: RequestField) -> click.Option:
    """Return the option of a field; nothing, or 0, leaves the field to the mission."""
    kind, names, metavar = field.type, [field.option, name], field.metavar or None
    if kind.kind == "list":
        return click.Option(names, metavar=metavar, callback=_split, help=field.doc)
    if kind.kind == "bool":
        return click.Option(names, is_flag=True, help=field.doc)
    if kind.kind == "text":
        return click.Option(names, metavar=metavar, default="", help=field.doc)
    whole = kind.kind == "integer"
    bounds = click.FloatRange(kind.minimum, kind.maximum)
    span = click.IntRange(_whole(kind.minimum), _whole(kind.maximum)) if whole else bounds
    return click.Option(names, type=span, metavar=metavar, default=0, help=field.doc)


def _whole(bound: float | None) -> int | None:
    return None if bound is None else int(bound)


def _split(_: click.Context, __: click.Parameter, text: str | None) -> list[str]:
    return [part.strip() for part in (text or "").split(",") if part.strip()]


fields = click.option(
    REQUEST,
    "fields",
    metavar="NAME=VALUE",
    multiple=True,
    help="Any field of the mission's request, such as patience='90 s' or amounts=1,5.",
)
settings = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the mission, such as nav_timeout_s='90 s', or of a node, written NODE.NAME=VALUE.",
)
#: For verbs without ROS, where no node runs.
mission_settings = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter, such as nav_timeout_s='90 s'.",
)
sim = click.option(
    "--sim",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the simulated robot, such as drain_per_s=0.01.",
)
speed = click.option(
    "--speed",
    type=click.FloatRange(min=0.02, max=20.0),
    default=1.0,
    help="How many times as fast the simulated robot drives.",
)
no_sim = click.option("--no-sim", is_flag=True, help="Start no simulated robot: wait for the real one.")
no_respawn = click.option(
    "--no-respawn", is_flag=True, help="Leave a node that dies dead: something else starts it again."
)
compose = click.option(
    "--compose/--separate",
    default=None,
    help="Nodes that may share one process do, or have one each; default: they do where the robot is "
    "simulated. Orchestrator, watchdog and gateway always have their own.",
)
hmi = click.option("--hmi", is_flag=True, help="Serve people's pages too, on this machine only.")
pages_port = click.option(
    "--port",
    type=click.IntRange(1, 65535),
    default=8080,
    show_default=True,
    help="Port of the pages that --hmi serves.",
)
opened = click.option(
    "--open", "opened", is_flag=True, help="With --hmi: to other machines too; asks for TLS files and tokens."
)
#: The file that `lupin learn` writes and `lupin expect` reads when no other is named.
LEARNED = Path("learned.yaml")


def _take_robot(_: click.Context, __: click.Parameter, text: str | None) -> None:
    """Set the robot of this process and its children, as its environment variable does."""
    if text is not None:
        os.environ[ROBOT] = read_robot(text)


robot = click.option(
    "--robot",
    metavar="NAMESPACE",
    expose_value=False,
    callback=_take_robot,
    help="ROS namespace of the robot's names, such as robot2; default: LUPIN_ROBOT, else none.",
)
_domain = click.option(
    "--domain", type=read_domain, metavar="NUMBER", help="ROS domain; default: ROS_DOMAIN_ID, else 0."
)


def domain(command: _F) -> _F:
    """Add the options that say which robot's nodes are meant."""
    return _domain(robot(command))


journal = click.option(
    "--journal",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of the journal; default: that of ROS domain and robot, in the user's state folder.",
)
field = click.option(
    "--field",
    multiple=True,
    metavar="JOURNAL",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder of a robot's journal, to compare with what has happened there; may be given again.",
)
frame_prefix = click.option(
    "--frame-prefix", default="", help="What stands before the frames of every node, such as robot2/."
)
log_dir = click.option(
    "--log-dir", type=click.Path(file_okay=False, path_type=Path), help="Folder for the nodes' logs."
)


def bring_up(command: _F) -> _F:
    """Add the options of verbs that bring up nodes, in this order."""
    network = (domain, frame_prefix, log_dir)
    for option in reversed((settings, speed, sim, no_sim, no_respawn, compose, hmi, opened, *network)):
        command = option(command)
    return command
