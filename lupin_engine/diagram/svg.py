"""Graphviz text to SVG, by the program `dot` or its port `graphviz-pure`, where one is installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from lupin_engine.errors import LupinError

_PROGRAMS = ("dot", "graphviz-pure")
#: How long drawing may take, in seconds.
_PATIENCE_S = 60.0
_MISSING = (
    "SVG needs a program that is not installed: 'pip install graphviz-pure', or install graphviz;"
    " '--format mermaid' and '--format dot' need nothing"
)


def svg(text: str) -> str:
    """Draw Graphviz text.

    Raises:
        LupinError: there is no `dot`, or it fails; the text says what to do.
    """
    program = _find()
    if program is None:
        raise LupinError(_MISSING)
    try:
        drawn = subprocess.run(
            [program, "-Tsvg"], input=text, capture_output=True, text=True, timeout=_PATIENCE_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise LupinError(f"{program} could not draw the picture: {problem}") from problem
    if drawn.returncode:
        raise LupinError(f"{program} could not draw the picture: {drawn.stderr.strip()}")
    return drawn.stdout


def _find() -> str | None:
    """Return the program, also where it was installed beside this Python."""
    beside = str(Path(sys.executable).parent)
    found = (shutil.which(name, path=path) for name in _PROGRAMS for path in (None, beside))
    return next(filter(None, found), None)
