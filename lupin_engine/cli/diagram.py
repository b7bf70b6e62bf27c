"""`lupin diagram`: a mission as a picture, or a folder of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lupin_engine.diagram.formats import FORMATS


@click.command(short_help="Draw a mission.")
@click.argument("mission", required=False)
@click.option(
    "--format",
    "formats",
    type=click.Choice(list(FORMATS)),
    multiple=True,
    help="Default: by the file's name, else mermaid. With --all also several.",
)
@click.option("--output", "-o", type=click.Path(path_type=Path), help="File to write; default: print.")
@click.option("--focus", metavar="STATE", help="Draw this state, and greyed what leads there and from there.")
@click.option("--depth", type=click.IntRange(min=1), help="Draw so many levels; deeper states are collapsed.")
@click.option(
    "--trace",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Colour what a run visited, and how often: what 'lupin simulate --json' printed.",
)
@click.option(
    "--all",
    "folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Draw every mission of a folder; the output is a folder, with an index.",
)
def diagram(**given: Any) -> int:
    """Draw a mission with the lifecycle around it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. SVG needs nothing but this
    program; PNG needs the package's extra 'diagram'. Mermaid and PlantUML are for documentation sites, DOT is
    for Graphviz, SCXML for other statechart tools.
    """
    from lupin_engine.cli.tasks.diagram import work

    return work(**given)
