"""`lupin upgrade`: shows what an older project would have to change for this engine; writes it on request.

Exit codes: 0 nothing is left to be mended by hand; 1 something is; 2 wrong usage, or a file is read-only.
"""

from __future__ import annotations

import json
import stat
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_cli.upgrades import FolderUpgrade


@click.command()
@click.argument("folder", default=".", type=click.Path(path_type=Path))
@click.option("--write", is_flag=True, help="Write the changes.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def upgrade(folder: Path, write: bool, as_json: bool) -> int:
    """Show what missions, scenarios and bindings would have to change for this engine.

    FOLDER is a project, by default the current folder: its folders of missions and its scenarios. What an
    older engine accepted, and this one warns of, is shown as a diff; --write writes it. Comments and line
    breaks stay. Robots do as before, except that a FAULT publishes the targets that are left. Rights in
    lupin.yaml are the owner's: what asks for them is listed.

    Exit code: 0 when nothing is left to be mended by hand, else 1; 2 for wrong usage, or a file that cannot
    be written.
    """
    from lupin_cli.upgrades import upgrade_folder

    found = upgrade_folder(folder, load_catalog())
    if write:
        _write(found)
    if as_json:
        click.echo(json.dumps(_record(found, write), indent=2, ensure_ascii=False))
    else:
        _print(found, folder, write)
    return 1 if found.left else 0


def _write(found: FolderUpgrade) -> None:
    """Write all files; where one is read-only none.

    Raises:
        UsageError: one cannot be written.
    """
    from lupin_cli.files import write_text

    for path in found.changed:
        if not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
            raise UsageError(f"cannot write {found.shown(path)!r}: it is read-only; nothing was written")
    for path in found.changed:
        write_text(path, found.after[path].decode())


def _print(found: FolderUpgrade, folder: Path, written: bool) -> None:
    from lupin_cli.terminal.findings import counted

    for path in found.changed:
        click.echo(f"{found.shown(path)}: written" if written else found.diff(path), nl=written)
    for one in found.left:
        click.echo(str(one).replace(f"{Path.cwd()}/", ""))
    if found.left:
        click.echo(f"{counted(len(found.left), 'finding')} left, which you must mend")
    if found.changed and not written:
        where = "" if folder == Path() else f" {folder}"
        files = counted(len(found.changed), "file")
        click.echo(f"{files} would change; write them with 'lupin upgrade{where} --write'")
    if not found.changed and not found.left:
        counts = f"{counted(found.missions, 'mission')} and {counted(found.scenarios, 'scenario')}"
        click.echo(f"nothing to upgrade in {counts}")


def _record(found: FolderUpgrade, written: bool) -> dict[str, object]:
    changes = [
        {"file": found.shown(path), "rules": sorted(set(found.rows[path])), "diff": found.diff(path)}
        for path in found.changed
    ]
    left = [
        {
            "file": found.shown(Path(one.place.file)),
            "line": one.place.line,
            "column": one.place.column,
            "severity": one.kind,
            "rule": one.rule,
            "message": one.message,
        }
        for one in found.left
    ]
    return {"written": written, "changes": changes, "left": left}
