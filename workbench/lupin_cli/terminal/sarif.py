"""Findings as SARIF 2.1.0, which code hosts and editors show beside the lines that they are about."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lupin_cli.terminal.excerpt import Sources, token_length
from lupin_engine import __version__
from lupin_engine.chart import RULES, SUBJECTS
from lupin_engine.errors import Diagnostic, Place

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(found: Iterable[Diagnostic], here: Path) -> str:
    """Return findings as a SARIF log; files below the folder `here` are named as from there."""
    diagnostics = list(found)
    sources = Sources()
    rules = sorted({diagnostic.rule for diagnostic in diagnostics})
    run = {
        "tool": {
            "driver": {
                "name": "lupin check",
                "semanticVersion": __version__,
                "rules": [_rule(rule) for rule in rules],
            }
        },
        "columnKind": "unicodeCodePoints",
        "results": [_result(d, rules.index(d.rule), here, sources) for d in diagnostics],
    }
    log = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(log, indent=2, ensure_ascii=False)


def _rule(rule: str) -> dict[str, Any]:
    subject = next(name for name, rules in SUBJECTS.items() if rule in rules)
    return {
        "id": rule,
        "shortDescription": {"text": f"{RULES[rule][:1].upper()}{RULES[rule][1:]}."},
        "help": {"text": f"lupin check --explain {rule}"},
        "properties": {"tags": [subject]},
    }


def _result(diagnostic: Diagnostic, rule: int, here: Path, sources: Sources) -> dict[str, Any]:
    hint = f"; {diagnostic.hint}" if diagnostic.hint else ""
    result: dict[str, Any] = {
        "ruleId": diagnostic.rule,
        "ruleIndex": rule,
        "level": diagnostic.kind,
        "message": {"text": f"{diagnostic.problem}{hint}"},
        "locations": [{"physicalLocation": _location(diagnostic.place, here, sources)}],
    }
    if diagnostic.path:
        result["locations"][0]["logicalLocations"] = [{"fullyQualifiedName": diagnostic.path}]
    return result


def _location(place: Place, here: Path, sources: Sources) -> dict[str, Any]:
    region: dict[str, Any] = {"startLine": place.line, "startColumn": place.column}
    line = sources.line(place)
    if line is not None:
        region["endColumn"] = place.column + token_length(line, place.column)
        region["snippet"] = {"text": line}
    file = here / place.file
    uri = quote(file.relative_to(here).as_posix()) if file.is_relative_to(here) else file.as_uri()
    return {"artifactLocation": {"uri": uri}, "region": region}
