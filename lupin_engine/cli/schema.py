"""`lupin schema`: the JSON Schema of missions, parts, lifecycles and scenarios, for editors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click


@click.command(short_help="Print the JSON Schema of the files, for editors.")
@click.argument("kind", required=False)
@click.option("--catalog", "with_names", is_flag=True, help="Include the names that the plugins offer.")
@click.option(
    "--write", "folder", type=click.Path(file_okay=False, path_type=Path), help="Write all of them there."
)
def schema(**given: Any) -> int:
    """Print the JSON Schema of a KIND of file.

    KIND is lifecycle, mission, part, binding, scenario, or lupin for all of them.

    Editors complete and check YAML with it. With --catalog it lists the operations, actions, events and live
    values of the plugins that are installed here.
    """
    from lupin_engine.cli.tasks.schema import work

    return work(**given)
