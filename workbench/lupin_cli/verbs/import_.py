"""`lupin import`: makes missions of charts in other formats."""

from __future__ import annotations

from pathlib import Path

import click

from lupin_engine.errors import UsageError


@click.group("import", short_help="Make a mission of a chart by others (SCXML).")
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
    from lupin_cli.files import title_of
    from lupin_cli.verbs.check import check_paths
    from lupin_cli.verbs.new import write_mission
    from lupin_engine.missions import LOCAL
    from lupin_engine.replay import yaml_text
    from lupin_scxml import from_scxml, read_document

    name = name or "".join(c if c.isalnum() else "_" for c in file.stem).lower()
    try:
        found = from_scxml(read_document(file), title_of(name), name)
    except UsageError as problem:
        raise UsageError(f"{file}: {problem}") from None
    head = f"# Made from {file.name} by 'lupin import scxml'.\n"
    binding = head + yaml_text(found.binding) if found.binding else ""
    written, _ = write_mission(name, None, Path(), head + yaml_text(found.mission), binding)
    for other in written:
        click.echo(f"wrote {other}")
    for old, new in found.names.items():
        click.echo(f"named {old}: {new}")
    for note in found.notes:
        click.echo(f"{file}:{note.line}: {'not said' if note.lost else 'note'}: {note.text}")
    wrong = check_paths([Path(LOCAL) / f"{name}.yaml"])
    return 1 if wrong or any(note.lost for note in found.notes) else 0
