"""`lupin bundle`: a mission with all that it is made of in one file, signed."""

from __future__ import annotations

from pathlib import Path

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin.registry import load_catalog


@click.command(short_help="Put a mission with all its files into one, signed.")
@click.argument("mission")
@click.option(
    "--sign",
    "key",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="KEY",
    help="Sign it with this private key: Ed25519, PEM.",
)
@click.option(
    "--output",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.lupin",
    help="Default: the mission's name, in the current folder.",
)
def bundle(mission: str, key: Path | None, output: Path | None) -> int:
    """Put a mission with all its files into one: lifecycle, parts, bindings, and a signature of them.

    Wherever a mission is named, its bundle can be named instead. An orchestrator with the parameter
    require_signed takes nothing but bundles that were signed with a key that it knows. Keys are made with
    openssl genpkey -algorithm ed25519 -out KEY and openssl pkey -in KEY -pubout -out KEY.pub.pem.

    Exit code: 0 written, 1 the mission has errors, 2 wrong usage.
    """
    from lupin_engine.missions.bundle import make_bundle
    from lupin_engine.missions.folders import BUNDLE
    from lupin_engine.missions.selection import load_missions
    from lupin_engine.plugin.files import write_atomically

    loaded = load_missions([mission], load_catalog())
    file = output or Path(loaded.files[0].stem + BUNDLE)
    if file.suffix != BUNDLE:
        raise UsageError(f"--output: {str(file)!r} must end in {BUNDLE}")
    files = {loaded.short_names[name]: raw for name, raw in loaded.sources.items()}
    content = make_bundle(loaded.files[0].name, loaded.hash, files, key)
    try:
        write_atomically(file, content)
    except OSError as problem:
        raise UsageError(f"cannot write {str(file)!r}: {problem.strerror}") from None
    signed = f"signed with {key}" if key else "not signed"
    click.echo(f"wrote {file}: {', '.join(loaded.names)}, {len(files)} files, {signed}")
    return 0
