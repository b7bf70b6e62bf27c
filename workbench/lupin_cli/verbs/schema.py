"""`lupin schema`: prints the JSON Schema of missions, parts, lifecycles and scenarios, for editors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from lupin_engine.errors import UsageError, nearest
from lupin_engine.plugin import load_catalog

#: Short forms of mappings in scenarios, by model.
SHORT_FORMS: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        "OutcomeNode": {"enum": ["done", "never"]},
        "RequestNode": {
            "description": "mission.start or operator.NAME, alone or with what it carries",
            "anyOf": [{"type": "string"}, {"type": "object", "minProperties": 1, "maxProperties": 1}],
        },
        "EventNode": {
            "description": "plugin.name, alone or with its fields",
            "anyOf": [{"type": "string"}, {"type": "object", "minProperties": 1, "maxProperties": 1}],
        },
        "EndNode": {"type": "string", "description": "operation, as plugin.name"},
        "RefusedNode": {"type": "string", "description": "code"},
    }
)
#: Lists of scenarios whose only element may stand without the list.
ONE_ALONE = ("MockNode.then",)


@click.command(short_help="Print the JSON Schema of the files, for editors.")
@click.argument("kind", required=False)
@click.option("--catalog", "with_names", is_flag=True, help="Include the names that the plugins offer.")
@click.option(
    "--write",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write one of each kind there.",
)
def schema(kind: str | None, with_names: bool, folder: Path | None) -> int:
    """Print the JSON Schema of a KIND of file.

    KIND is lifecycle, mission, part, binding, scenario, or lupin for all of them.

    Editors complete and check YAML with it. With --catalog it lists the operations, actions, events and live
    values of the plugins that are installed here.

    Exit code: 0 printed or written; 2 no such kind, or a file cannot be written.
    """
    from lupin_lsp import ANY_KIND, text_of, write

    kind = kind or ANY_KIND
    found = schemas(with_names)
    if kind not in found:
        raise UsageError(f"no kind of file {kind!r}; {nearest(kind, found)}")
    if folder is None:
        click.echo(text_of(found[kind]), nl=False)
        return 0
    try:
        del found[ANY_KIND]  # made when somebody asks for it: it repeats the others
        write(folder, found, lambda path: click.echo(path))
    except OSError as problem:
        raise UsageError(f"cannot write to {str(folder)!r}: {problem.strerror}") from problem
    return 0


def schemas(with_names: bool = False) -> dict[str, dict[str, Any]]:
    """Return the schemas of all kinds of files, and of any; PluginError where a plugin cannot be used."""
    from lupin_engine.sim import ScenarioNode
    from lupin_lsp import all_schemas, kinds

    models = kinds({"scenario": ScenarioNode})
    catalog = load_catalog()
    named = catalog if with_names else None
    return all_schemas(models, SHORT_FORMS, ONE_ALONE, named, catalog.profile)
