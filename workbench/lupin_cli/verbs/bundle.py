"""`lupin bundle`: packs a mission with all its files into one signed file."""

from __future__ import annotations

from pathlib import Path

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin import load_catalog


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
    "--version",
    metavar="N",
    default="",
    help="An integer or one like 1.2.3: a robot that has run a newer one refuses this.",
)
@click.option("--name", metavar="NAME", default="", help="Of what has the version; default: the mission.")
@click.option(
    "--output",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.lupin",
    help="Default: the mission's name, in the current folder.",
)
def bundle(mission: str, key: Path | None, version: str, name: str, output: Path | None) -> int:
    """Put a mission with all its files into one: lifecycles, parts, bindings, and a signature of them.

    Wherever a mission is named, its bundle can be named instead. An orchestrator with the parameter
    require_signed takes nothing but bundles that were signed with a key that it knows. Keys are made with
    openssl genpkey -algorithm ed25519 -out KEY and openssl pkey -in KEY -pubout -out KEY.pub.pem.

    Exit code: 0 written, 1 the mission has errors, 2 wrong usage.
    """
    from lupin_engine.missions import BUNDLE, load_missions, make_bundle
    from lupin_engine.plugin import write_atomically

    loaded = load_missions([mission], load_catalog())
    file = output or Path(loaded.files[0].stem + BUNDLE)
    if file.suffix != BUNDLE:
        raise UsageError(f"--output: {str(file)!r} must end in {BUNDLE}")
    files = {loaded.short_names[name]: raw for name, raw in loaded.sources.items()}
    if name and not version:
        raise UsageError("--name: it needs --version")
    name = (name or loaded.files[0].stem) if version else ""
    content = make_bundle(loaded.files[0].name, loaded.hash, files, key, name, version)
    try:
        write_atomically(file, content)
    except OSError as problem:
        raise UsageError(f"cannot write {str(file)!r}: {problem.strerror}") from None
    signed = f"signed with {key}" if key else "not signed"
    of = f" ({name} {version})" if version else ""
    click.echo(f"wrote {file}: {', '.join(loaded.names)}{of}, {len(files)} files, {signed}")
    if key and not version:
        click.echo("warning: without --version an older one in its place would not be noticed", err=True)
    return 0
