"""`lupin lsp`: runs the language server, for editors."""

from __future__ import annotations

import contextlib
import os
import sys

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin import load_catalog


@click.command(short_help="Serve editors: completion, hover, definition, rename, findings as you type.")
def lsp() -> int:
    """Serve an editor over standard input and output (Language Server Protocol).

    Editors start this themselves; docs/editor.md says what to write into their settings.

    Exit code: 0 the editor has ended it; 2 the package's extra 'editor' is missing.
    """
    try:
        from lupin_lsp import serve
    except ModuleNotFoundError as problem:
        if (problem.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        hint = "python3 -m pip install 'lupin-engine[editor]'"
        raise UsageError(
            f"the language server needs {problem.name}, which is missing; run: {hint}"
        ) from problem
    # The protocol has standard output to itself: what a plugin prints would be taken for a message.
    with contextlib.redirect_stdout(sys.stderr), os.fdopen(os.dup(1), "wb") as stdout:
        serve(load_catalog(), stdout)
    return 0
