"""`lupin new`: a folder in which a mission can be written: the mission, its lifecycle, a scenario.

What stands there already is left as it is; a mission that exists is never written over.
"""

from __future__ import annotations

from typing import Any

import click


@click.command(short_help="Begin a mission: its file, the lifecycle around it, a scenario.")
@click.argument("name")
@click.option("--like", metavar="MISSION", help="Begin with a copy of this mission, and the parts it uses.")
def new(**given: Any) -> int:
    """Begin a mission: its file, the lifecycle around it, a scenario.

    NAME is what the file is called, such as water_beds. In the current folder this writes
    missions/NAME.yaml and scenarios/NAME.scenario.yaml, and copies missions/lifecycle.yaml where there is
    none. What exists is left as it is.

    Example: lupin new my_inspection --like inspection
    """
    from lupin_engine.cli.tasks.new import work

    return work(**given)
