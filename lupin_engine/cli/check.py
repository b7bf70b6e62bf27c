"""`lupin check`: tell everything that is wrong with missions, before a robot does."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from lupin_engine.chart.load import (
    LIFECYCLE,
    PARTS,
    check_chart,
    default_missions_folder,
    find_mission,
    lifecycle_of,
    mission_files,
)
from lupin_engine.chart.source import head
from lupin_engine.errors import Diagnostic, Severity, UsageError
from lupin_engine.plugin.registry import load_catalog


@click.command()
@click.argument("paths", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as a JSON list.")
def check(paths: tuple[str, ...], as_json: bool) -> int:
    """Check missions and tell everything that is wrong with them.

    PATHS are mission files, lifecycles, parts, folders, or names of shipped missions; without any, all
    shipped missions are checked. Errors make the exit code 1, warnings do not.
    """
    return check_paths(paths, as_json)


def check_paths(paths: Sequence[str | Path], as_json: bool = False) -> int:
    """Check what `paths` name, print the findings and return the exit code.

    Raises:
        UsageError: a path does not exist.
        PluginError: the installed plugins cannot be used.
    """
    groups: dict[Path, dict[Path, None]] = {}
    for path in paths or [default_missions_folder()]:
        lifecycle, missions = _meant_by(str(path))
        groups.setdefault(lifecycle, {}).update(dict.fromkeys(missions))
    catalog = load_catalog()
    found = {d: None for root, files in groups.items() for d in check_chart(root, list(files), catalog)[1]}
    click.echo(_as_json(found) if as_json else _as_text(found, sum(map(len, groups.values()))))
    return 1 if any(d.severity is Severity.ERROR for d in found) else 0


def _meant_by(name: str) -> tuple[Path, list[Path]]:
    """Return the lifecycle and the missions to check for a path or a mission's name."""
    path = Path(name)
    if path.is_dir():
        return path / LIFECYCLE, mission_files(path)
    if not path.is_file():
        mission = find_mission(name, [default_missions_folder()])
        return lifecycle_of(mission), [mission]
    kind = (head(path) or ("", ""))[0]
    if path.name == LIFECYCLE or kind == "lifecycle":
        return path, mission_files(path.parent)
    if kind == "part" and path.parent.name == PARTS:
        folder = path.parent.parent
        return folder / LIFECYCLE, mission_files(folder)
    if kind == "part":
        raise UsageError(f"the part {name!r} does not stand in a folder {PARTS!r} beside missions")
    return lifecycle_of(path), [path]


def _as_text(found: Iterable[Diagnostic], missions: int) -> str:
    diagnostics = list(found)
    errors = sum(d.severity is Severity.ERROR for d in diagnostics)
    counts = [
        _counted(missions, "mission"),
        _counted(errors, "error"),
        _counted(len(diagnostics) - errors, "warning"),
    ]
    return "\n".join([*map(str, diagnostics), ", ".join(counts)])


def _counted(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def _as_json(found: Iterable[Diagnostic]) -> str:
    return json.dumps(
        [
            {
                "file": d.place.file,
                "line": d.place.line,
                "column": d.place.column,
                "severity": "error" if d.severity is Severity.ERROR else "warning",
                "rule": d.rule,
                "path": d.path,
                "problem": d.problem,
                "hint": d.hint,
            }
            for d in found
        ],
        indent=2,
        ensure_ascii=False,
    )
