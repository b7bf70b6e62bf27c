"""The options that several verbs share, and what is known both to those who declare one and who follow it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from lupin_engine.ros.launch.environment import HIGHEST_DOMAIN

_F = TypeVar("_F", bound=Callable[..., Any])

#: How long a mission may wait for an operator when nobody watches a terminal, in seconds.
PATIENCE_S = 60.0
#: Stands for the terminal where a file could be named.
TERMINAL = "-"
#: What the file of a timeline ends in.
SVG, PNG = ".svg", ".png"


def _tags(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


tags = click.option(
    "--tags", metavar="1,5,12", callback=_tags, help="The tags to visit; default: the mission's own."
)
settings = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the mission, such as nav_timeout_s='90 s', or of a node, such as "
    "greenhouse_bridge.backend=mqtt.",
)
sim = click.option(
    "--sim",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the simulated robot, such as battery=0.1.",
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
domain = click.option(
    "--domain",
    type=click.IntRange(min=0, max=HIGHEST_DOMAIN),
    help="ROS domain; default: ROS_DOMAIN_ID, else 0.",
)
log_dir = click.option(
    "--log-dir", type=click.Path(file_okay=False, path_type=Path), help="Folder for the nodes' logs."
)


def bring_up(command: _F) -> _F:
    """Add the options of verbs that bring up nodes, in this order."""
    for option in reversed((settings, speed, sim, no_sim, no_respawn, domain, log_dir)):
        command = option(command)
    return command
