"""`lupin diagram`: a mission as a picture."""

from __future__ import annotations

from pathlib import Path

import click

from lupin_engine.diagram.dot import dot
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.errors import UsageError
from lupin_engine.launch.mission import load_missions
from lupin_engine.plugin.registry import load_catalog

#: What an output file's name says about its format.
_ENDINGS = {".mmd": "mermaid", ".mermaid": "mermaid", ".dot": "dot", ".gv": "dot", ".svg": "svg"}


@click.command(short_help="Draw a mission.")
@click.argument("mission")
@click.option(
    "--format",
    "wanted",
    type=click.Choice(["mermaid", "dot", "svg"]),
    help="Default: by the file's name, else mermaid.",
)
@click.option(
    "--output", "-o", type=click.Path(dir_okay=False, path_type=Path), help="File to write; default: print."
)
def diagram(mission: str, wanted: str | None, output: Path | None) -> int:
    """Draw a mission with the lifecycle around it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. Mermaid is drawn by many
    documentation sites; SVG needs graphviz or the package graphviz-pure.
    """
    text = draw(mission, wanted or (_ENDINGS.get(output.suffix, "mermaid") if output else "mermaid"))
    if output is None:
        click.echo(text, nl=False)
        return 0
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise UsageError(f"cannot write {str(output)!r}: {problem.strerror}") from problem
    return 0


command = diagram


def draw(mission: str, wanted: str) -> str:
    """Return a mission as text in one of the formats."""
    picture = outline(load_missions([mission], load_catalog()).chart)
    if wanted == "mermaid":
        return mermaid(picture)
    return dot(picture) if wanted == "dot" else svg(dot(picture))
