"""Verbs that installed packages bring.

A profile brings one for each request of an operator. Other verbs are entry points of the group
`lupin.verbs`, each naming a click command. Such a package is imported when its verb is called, not before. So
the line in the list of verbs comes from the source: the first paragraph of the docstring of the function that
the entry point names.
"""

from __future__ import annotations

import ast
import contextlib
import functools
from collections.abc import Mapping, Sequence

import click

from lupin_engine.errors import PluginError
from lupin_engine.plugin import PROFILES, VERBS, EntryPoint, Profile, entry_points, source_file


def plugin_verbs() -> Mapping[str, Sequence[EntryPoint]]:
    """Return the installed verbs by name; a name with more than one entry point is an error when called."""
    found: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=VERBS):
        found.setdefault(point.name, []).append(point)
    return found


@functools.cache
def request_verbs() -> Mapping[str, str]:
    """Return the verbs with their lines of help; of two profiles the first defines it."""
    found: dict[str, str] = {}
    for point in entry_points(PROFILES):
        with contextlib.suppress(PluginError):  # whatever needs the profile says what is wrong with it
            profile = point.load_as(Profile, "profile", "a Profile")
            for name, verb in profile.verbs.items():
                found.setdefault(verb, profile.requests[name].doc)
    return found


def summary(points: Sequence[EntryPoint]) -> str:
    """Return the line of a verb in the list of verbs."""
    if len(points) > 1:
        return f"(offered more than once: {_offers(points)})"
    point = points[0]
    source = source_file(point.module)
    if source is None:
        return f"({point}: there is no module {point.module})"
    return _first_paragraph(source, point.attribute) or f"({point})"


def load_verb(points: Sequence[EntryPoint]) -> click.Command:
    """Import a verb.

    Raises:
        PluginError: it cannot be imported, is no command, or two packages offer it.
    """
    if len(points) > 1:
        offered = f"verb {points[0].name!r} is offered more than once: {_offers(points)}"
        raise PluginError(f"{offered}; uninstall all but one")
    return points[0].load_as(click.Command, "verb", "a click command")


def _offers(points: Sequence[EntryPoint]) -> str:
    return " and ".join(map(str, points))


def _first_paragraph(source: str, function: str) -> str:
    """Return the beginning of a function's docstring; '' where there is none to be read."""
    try:
        with open(source, encoding="utf-8") as file:
            tree = ast.parse(file.read())
    except (OSError, SyntaxError, ValueError):
        return ""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            paragraph = (ast.get_docstring(node) or "").partition("\n\n")[0]
            return " ".join(paragraph.split())
    return ""
