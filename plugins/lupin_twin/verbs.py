"""The verb `lupin twin`: lists, exports and draws the twin's store."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from lupin_engine.plugin import read_domain

Command = TypeVar("Command", bound=Callable[..., Any])

FORMATS = ("csv", "geojson")


@click.group()
def twin() -> None:
    """Show, list, export or plot the digital twin's records: show, missions, export, plot.

    All of them read the twin's store, also while a twin writes to it, and need no ROS.

    Exit code of each: 0 done; 1 the store cannot be read, or a file cannot be written; 2 wrong usage.
    """


def _store(command: Command) -> Command:
    """Add the options that select the store."""
    file = click.option(
        "--store",
        metavar="FILE",
        default="",
        help="The twin's store_file; default: the one of the domain, in the user's state folder.",
    )
    domain = click.option(
        "--domain",
        type=read_domain,
        metavar="NUMBER",
        help="ROS domain of the twin; default: $ROS_DOMAIN_ID, else 0.",
    )
    return file(domain(command))


def _mission(default: str) -> Callable[[Command], Command]:
    return click.option(
        "--mission",
        metavar="ID",
        default=default,
        show_default=True,
        help="A mission's id (see 'lupin twin missions'), 'latest' or 'all'.",
    )


@twin.command()
@_store
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object.")
def show(**given: Any) -> int:
    """List the tags: where they are, what grows there, the latest readings and how old they are."""
    from lupin_twin.commands import show as work

    return work(**given)


@twin.command()
@_store
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object.")
def missions(**given: Any) -> int:
    """List the missions with observations in the store."""
    from lupin_twin.commands import missions as work

    return work(**given)


@twin.command()
@_store
@_mission("latest")
@click.option("--format", "format_", type=click.Choice(FORMATS), help="Default: by the file's name.")
@click.option("--output", "-o", required=True, metavar="FILE", help="File to write; - prints.")
@click.option(
    "--origin",
    metavar="LAT,LON[,DIR]",
    help="Where the map's origin is and which way its x axis points, in degrees; DIR from north, default 90.",
)
def export(**given: Any) -> int:
    """Write a mission's record: CSV or GeoJSON.

    CSV has places in metres on the map, and beside it a description with units and types (CSV on the Web).
    GeoJSON has longitude and latitude, which needs --origin.

    Example: lupin twin export -o record.geojson --origin 51.9988,4.3735,90
    """
    from lupin_twin.commands import export as work

    return work(**given)


@twin.command()
@_store
@_mission("all")
@click.option("--sensor", default="all", show_default=True, help="One sensor, or all that were read.")
@click.option(
    "--output",
    "-o",
    required=True,
    type=click.Path(path_type=Path),
    help="A file (.png or .svg), or a folder for both of each sensor.",
)
@click.option("--distance", type=float, help="Metres from the nearest tag up to which values are shown.")
def plot(**given: Any) -> int:
    """Draw the field of a sensor between the tags.

    Example: lupin twin plot --sensor temperature -o temperature.png
    """
    from lupin_twin.commands import plot as work

    return work(**given)
