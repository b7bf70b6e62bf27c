"""The index page of the diagrams of a folder of missions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

_HEAD = """\
# Missions

Written by `lupin diagram --all`; not to be edited.
"""
_WORDS = {"mermaid": "Mermaid", "scxml": "SCXML", "svg": "SVG", "png": "PNG"}


@dataclass(frozen=True)
class Page:
    """A mission and its files, by format."""

    name: str
    summary: str
    files: Mapping[str, str]


def index(pages: Iterable[Page]) -> str:
    """Return the page as Markdown, with the pictures in it."""
    return "\n".join([_HEAD, *(_entry(page) for page in pages)])


def _entry(page: Page) -> str:
    shown = [name for format, name in page.files.items() if format in ("svg", "png")][:1]
    lines = [f"## {page.name}", "", *([page.summary, ""] if page.summary else [])]
    lines += [f"![{page.name}]({name})\n" for name in shown]
    links = [f"[{_WORDS[format]}]({name})" for format, name in page.files.items()]
    return "\n".join([*lines, " · ".join(links), ""])
