"""Returns the explanation of one rule of the checker from the page of rules."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import click

import lupin_engine
from lupin_engine.chart import RULES, SUBJECTS
from lupin_engine.errors import UsageError, nearest

_MARKED = re.compile(r"\*([^*]+)\*")


def rule_text(rule: str) -> str:
    """Return the purpose of a rule, with an example that breaks it.

    Raises:
        UsageError: there is no such rule; the text has the nearest spelling.
    """
    if rule not in RULES:
        raise UsageError(f"no rule {rule!r}; {nearest(rule, RULES)}")
    subject = next(name for name, rules in SUBJECTS.items() if rule in rules)
    title = f"{click.style(rule, bold=True)}  ({subject})"
    page = _page()
    section = _section(page.read_text(encoding="utf-8").splitlines(), rule) if page is not None else ()
    return "\n".join([title, "", *(_plain(section) or [f"{RULES[rule][:1].upper()}{RULES[rule][1:]}."])])


def _page() -> Path | None:
    """Return the page of the rules: in the checkout, or inside the installed package; None: in neither."""
    package = Path(lupin_engine.__file__).resolve().parent
    places = (package.parent / "docs" / "rules.md", package / "rules.md")
    return next((place for place in places if place.is_file()), None)


def _section(page: Iterable[str], rule: str) -> Iterator[str]:
    """Yield the lines below the heading of a rule."""
    inside = fenced = False
    for line in page:
        fenced ^= line.startswith("```")
        if inside and line.startswith("#") and not fenced:
            return
        if inside:
            yield line
        inside = inside or line == f"### {rule}"


def _plain(section: Iterable[str]) -> list[str]:
    """Return a section for the terminal: code blocks indented, the rest without markup."""
    found: list[str] = []
    fenced = False
    for line in section:
        if line.startswith("```"):
            fenced = not fenced
        else:
            found.append(f"    {line}".rstrip() if fenced else _MARKED.sub(r"(\1)", line).replace("`", ""))
    return "\n".join(found).strip("\n").splitlines()
