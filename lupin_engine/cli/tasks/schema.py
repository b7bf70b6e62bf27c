"""What `lupin schema` does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from lupin_engine.editor.schema import ANY_KIND, all_schemas, kinds, text_of, write
from lupin_engine.errors import UsageError, nearest
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.sim.scenario_file import ScenarioNode

#: What stands for a mapping in short, in scenarios.
SHORT_FORMS: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        "OutcomeNode": {"enum": ["done", "never"]},
        "RequestNode": {
            "description": "mission.start or operator.NAME, alone or with what it carries",
            "anyOf": [{"type": "string"}, {"type": "object", "minProperties": 1, "maxProperties": 1}],
        },
        "EndNode": {"type": "string", "description": "operation, as plugin.name"},
        "RefusedNode": {"type": "string", "description": "code"},
    }
)
#: Lists of scenarios of which the only element can stand without the list.
ONE_ALONE = ("MockNode.then",)


def work(kind: str | None, with_names: bool, folder: Path | None) -> int:
    """Do what the options of `lupin schema` say, and return the exit code."""
    kind = kind or ANY_KIND
    found = schemas(with_names)
    if kind not in found:
        raise UsageError(f"no kind of file {kind!r}; {nearest(kind, found)}")
    if folder is None:
        click.echo(text_of(found[kind]), nl=False)
        return 0
    try:
        write(folder, found, lambda path: click.echo(path))
    except OSError as problem:
        raise UsageError(f"cannot write to {str(folder)!r}: {problem.strerror}") from problem
    return 0


def schemas(with_names: bool = False) -> dict[str, dict[str, Any]]:
    """Return the schemas of all kinds of files, and of any."""
    models = kinds({"scenario": ScenarioNode})
    return all_schemas(models, SHORT_FORMS, ONE_ALONE, load_catalog() if with_names else None)
