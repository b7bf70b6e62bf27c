"""The tables of the editor name what there is, and all of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.compose.actions import STRUCTURED, builtin_actions
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS
from lupin_engine.chart.nodes import Node
from lupin_engine.plugin.profile import NO_PROFILE
from lupin_lsp import docs
from lupin_lsp.grammar import FILES, Shape, fields_of, kind_of, spot_at
from lupin_lsp.scan import Scan, Steps

ROOT = Path(__file__).parents[3]
WRITTEN = [*(ROOT / "missions").rglob("*.yaml"), *(ROOT / "tests" / "charts" / "good").rglob("*.yaml")]
GOOD = sorted(file for file in WRITTEN if file.name != "lupin.yaml")


def models() -> set[type[Node]]:
    """Return every model of the language."""
    found: set[type[Node]] = set()
    waiting: list[type[Node]] = [Node]
    while waiting:
        below = [m for m in waiting.pop().__subclasses__() if m.__module__.startswith("lupin_engine.")]
        found.update(below)
        waiting += below
    return found


def test_the_engines_own_words_are_documented() -> None:
    """What an expression can call and read, what an action can do, what can be asked for."""
    assert set(docs.CALLS) == set(BUILTIN_CALLS)
    assert set(docs.ROOTS) == set(ROOTS)
    assert set(docs.ACTIONS) == {*builtin_actions(NO_PROFILE), *STRUCTURED}


def test_every_key_of_the_language_is_described() -> None:
    """Hover and schema have nothing else to say."""
    silent = [
        (model.__name__, name)
        for model in sorted(models() - {Node}, key=lambda model: model.__name__)
        for name, field in fields_of(model).items()
        if not field.description and model.__name__ != "ActionNode"
    ]
    assert silent == []


@pytest.mark.parametrize("file", GOOD, ids=lambda file: file.stem)
def test_every_path_of_a_good_mission_is_known(file: Path) -> None:
    """The shapes read off the models are those of the language."""
    scan = Scan(file.read_text(encoding="utf-8"))
    root = kind_of(scan)
    assert root in FILES.values()
    assert root is not None
    unknown = [token.path for token in scan.tokens if spot_at(root, token.path) is None]
    assert [path for path in unknown if not is_data(root, path)] == []


def is_data(root: type[Node], path: Steps) -> bool:
    """Tell whether a path leads into a value, such as a default that is a record."""
    known = next(spot for at in range(len(path), -1, -1) if (spot := spot_at(root, path[:at])) is not None)
    return known.shape == Shape()
