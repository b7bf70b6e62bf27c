"""Writes the files of verbs, and makes valid names for them."""

from __future__ import annotations

import re
from pathlib import Path

from lupin_engine.errors import UsageError
from lupin_engine.plugin import NAME, write_atomically


def write_text(file: Path, text: str) -> None:
    """Write a file as a whole or not at all, in a folder that is made where it is missing.

    Raises:
        UsageError: it cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, text.encode())
    except OSError as problem:
        raise UsageError(f"cannot write {str(file)!r}: {problem.strerror}") from None


def title_of(name: str) -> str:
    """Return a name in camel case: `water_beds` becomes `WaterBeds`."""
    return "".join(word.capitalize() for word in name.split("_"))


def nearest_name(wanted: str) -> str:
    """Return a hint at a valid spelling of an invalid name, `''` where there is none."""
    name = re.sub(r"\W+|(?<=[a-z0-9])(?=[A-Z])", "_", wanted).strip("_").lower()
    return f"; did you mean {name!r}?" if NAME.fullmatch(name) and name != wanted else ""
