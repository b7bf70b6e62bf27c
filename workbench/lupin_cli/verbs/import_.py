"""`lupin import`: makes missions of charts in other formats."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_engine.errors import UsageError

if TYPE_CHECKING:
    from lupin_scxml import Imported


@click.group("import", short_help="Make a mission of a chart by others (SCXML, behavior trees).")
def import_() -> None:
    """Make a mission of a chart by others."""


@import_.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--name", help="What the mission's file is called; default: as FILE.")
def scxml(file: Path, name: str | None) -> int:
    """Make a mission of an SCXML document, such as those of XState, Qt or SCION.

    In the current folder this writes missions/NAME.yaml, and the shipped lifecycle where there is none.
    Events that nothing in the document raises are declared in missions/bindings/NAME.yaml, and allowed in
    lupin.yaml. Parts without an equivalent are listed with their lines; then the mission is checked.

    Exit code: 0 all was converted and nothing is wrong, 1 something was left out or is
    missing, 2 nothing was written.
    """
    from lupin_scxml import from_scxml

    return _convert(file, name, "scxml", from_scxml)


@import_.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--name", help="What the mission's file is called; default: as FILE.")
def tree(file: Path, name: str | None) -> int:
    """Make the skeleton of a mission of a behavior tree, such as those of Nav2 (BehaviorTree.CPP, XML).

    In the current folder this writes missions/NAME.yaml, and the shipped lifecycle where there is none. A
    tree says in which order things are done and not what is done, so each leaf becomes a question that says
    what is to be written there. These and all parts without an equivalent are listed with their lines; then
    the mission is checked.

    Exit code: 0 nothing is left to write, 1 something is, or is missing, 2 nothing was written.
    """
    from lupin_scxml import from_tree

    return _convert(file, name, "tree", lambda text, title, _: from_tree(text, title))


def _convert(file: Path, name: str | None, kind: str, read: Callable[[bytes, str, str], Imported]) -> int:
    """Write the mission of a document, list what was changed or left out, and check it."""
    from lupin_cli.files import title_of
    from lupin_cli.verbs.check import check_paths
    from lupin_cli.verbs.new import write_mission
    from lupin_engine.missions import LOCAL
    from lupin_engine.replay import yaml_text
    from lupin_scxml import read_document

    name = name or "".join(c if c.isalnum() else "_" for c in file.stem).lower()
    try:
        found = read(read_document(file), title_of(name), name)
    except UsageError as problem:
        raise UsageError(f"{file}: {problem}") from None
    head = f"# Made from {file.name} by 'lupin import {kind}'.\n"
    binding = head + yaml_text(found.binding) if found.binding else ""
    written, _ = write_mission(name, None, Path(), head + yaml_text(found.mission), binding)
    for other in written:
        click.echo(f"wrote {other}")
    for old, new in found.names.items():
        click.echo(f"named {old}: {new}")
    for note in found.notes:
        word = "to be written" if note.to_write else "not said" if note.lost else "note"
        click.echo(f"{file}:{note.line}: {word}: {note.text}")
    wrong = check_paths([Path(LOCAL) / f"{name}.yaml"])
    click.echo(f"next: lupin simulate {name} -i; lupin diagram {name}")
    return 1 if wrong or any(note.lost or note.to_write for note in found.notes) else 0
