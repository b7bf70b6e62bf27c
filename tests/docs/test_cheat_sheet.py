"""The cheat sheet names every word of the language, and none that does not exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from lupin_cli.main import OPERATOR_VERBS, VERBS, main
from lupin_engine.bindings import file as bindings
from lupin_engine.chart import documents
from lupin_engine.chart.compose.actions import STRUCTURED, builtin_actions
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS
from lupin_greenhouse.profile import PROFILE

PAGE = Path(__file__).parents[2] / "docs" / "cheat-sheet.md"
TEXT = PAGE.read_text(encoding="utf-8")
TABLE = re.compile(r"^<!-- words: (.+) -->\n\n((?:\|.*\n)+)", re.MULTILINE)
TABLES = {found[1]: found[2] for found in TABLE.finditer(TEXT)}
#: Of these a sheet has what comes up every day, not all.
SOME = ("verbs", "bindings")


def fields(*models: type[BaseModel]) -> set[str]:
    """The keys of models, as they are written."""
    return {field.alias or name for model in models for name, field in model.model_fields.items()}


def known(name: str) -> set[str]:
    """All words of a kind."""
    match name:
        case "actions":
            return {*builtin_actions(PROFILE), *PROFILE.publications, *STRUCTURED}
        case "requests":
            return set(PROFILE.events)
        case "roots":
            return set(ROOTS)
        case "calls":
            return set(BUILTIN_CALLS)
        case "verbs":
            return {*VERBS, *OPERATOR_VERBS, *(each.verb or key for key, each in PROFILE.requests.items())}
        case "bindings":
            models = (each for each in vars(bindings).values() if isinstance(each, type))
            return fields(*(each for each in models if issubclass(each, BaseModel)))
    return fields(getattr(documents, name))


def words(table: str) -> Iterator[str]:
    """The words in the first column."""
    for row in table.splitlines()[2:]:
        yield from re.findall(r"`([^`]+)`", row.split("|")[1])


@pytest.mark.parametrize("kinds", TABLES)
def test_a_table_names_the_words_that_exist(kinds: str) -> None:
    """No other; and all, where the sheet does not choose."""
    shown, exist = set(words(TABLES[kinds])), set[str]().union(*map(known, kinds.split()))
    assert sorted(shown - exist) == []
    if kinds not in SOME:
        assert sorted(exist - shown) == []


def test_every_model_of_the_language_has_its_place() -> None:
    """A new kind of element is missed."""
    placed = {kind for kinds in TABLES for kind in kinds.split()}
    models = {name for name in documents.__all__ if name.endswith("Node")}
    # An action's name; the shared part; a `do`; what `lupin new --copy` writes.
    by_words = {"ActionNode", "FileNode", "ElementEndNode", "OriginNode"}
    assert sorted(models - placed - by_words) == []


def test_its_mission_has_no_finding(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the shipped lifecycle."""
    (mission,) = re.findall(r"^```yaml\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    file = tmp_path / "sheet.yaml"
    file.write_text(mission, encoding="utf-8")
    assert main(["check", "--strict", str(file)]) == 0
    assert capsys.readouterr().out == "1 mission, no errors, no warnings\n"
