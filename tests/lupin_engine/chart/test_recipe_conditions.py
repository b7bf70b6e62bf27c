"""A condition that is added to any part of the language, as the recipe of docs/CONTRIBUTING.md has it.

Proofs know that it decides, and the rules that they do not know what it says. Nobody has to write that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import field, fields, make_dataclass, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart import model as m
from lupin_engine.chart.compose.compose import Composed
from lupin_engine.chart.expressions.evaluation import Compiled, Constant, Expression
from lupin_engine.chart.records import Role, parts_of, said
from lupin_engine.chart.rules import checks
from lupin_engine.chart.rules.index import Index
from lupin_engine.machine.scope import CONTEXT, EvaluationScope, World
from lupin_engine.machine.structure import LevelRules
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart, forget
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import BOOL
from lupin_engine.runtime.possible import _reads
from lupin_verify.situations.compared import Compared
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.levels import explore
from lupin_verify.situations.relevance import Relevance
from tests.lupin_engine.chart.test_recipe import BECOMES, PLACE, exchanged, records
from tests.lupin_engine.chart.test_words import WORDS, wide_catalog
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import chart as built

CHARTS = Path(__file__).parents[2] / "charts"
KINDS = list(dict.fromkeys(BECOMES.values()))
#: Rules that ask whether conditions hold: what they tell of one that they understand.
ASKING = ("never-wins", "both-can-win", "always-loop")
BROKEN = [
    path.with_suffix(".yaml")
    for path in sorted((CHARTS / "broken").glob("*.txt"))
    if any(f"[{rule}]" in path.read_text(encoding="utf-8") for rule in ASKING)
]
NUMBERS = count()


@cache
def kind_with_more(kind: type) -> type:
    """Return a kind of record that has one more condition."""
    barred_by = field(default=None, metadata=said(Role.CONDITION, "barred_by"))
    return make_dataclass(kind.__name__, [("barred_by", Any, barred_by)], bases=(kind,), unsafe_hash=True)


def planted(thing: Any) -> Any:
    """Return a record with one more condition, which is no other record's."""
    values = {one.name: getattr(thing, one.name) for one in fields(thing)}
    return kind_with_more(type(thing))(**values, barred_by=reads("planted", f"planted_{next(NUMBERS)}"))


def reads(variable: str, source: str = "") -> Expression:
    """Return a checked condition that reads a variable."""
    return Expression(source or variable, PLACE, BOOL, Compiled(f"env['context'][{variable!r}]"))


def with_variable(chart: m.Chart) -> m.Chart:
    """Return a chart that has the variable, which nothing reads."""
    variable = m.Variable("planted", BOOL, Constant(True, PLACE, BOOL), PLACE)
    return replace(chart, context={**chart.context, "planted": variable})


def planted_in(chart: m.Chart, kind: type) -> m.Chart:
    """Return a chart in which one record of a kind has one more condition."""
    family, holder, found = next(records(chart, kind))
    changed = exchanged(holder, found, planted(found))
    return replace(
        chart, **{family: {n: changed if t is holder else t for n, t in getattr(chart, family).items()}}
    )


def planted_everywhere(thing: Any) -> Any:
    """Return a record in which every transition and every action has one more condition."""
    changes = {}
    for part in parts_of(type(thing)):
        value = getattr(thing, part.field)
        if part.role not in (Role.INSIDE, Role.ACTIONS) or value is None:
            continue
        if isinstance(value, tuple):
            changes[part.field] = tuple(map(planted_everywhere, value))
        elif not isinstance(value, dict):
            changes[part.field] = planted_everywhere(value)
    new = replace(thing, **changes)
    return planted(new) if type(new) in (m.Transition, m.ActionCall) else new


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., set[str]]]:
    """Check missions whose charts are changed before the rules look at them; return what these tell of."""

    def told(
        lifecycle: Path, mission: Path, catalog: Catalog, change: Callable[[m.Chart], m.Chart]
    ) -> set[str]:
        def index(composed: Composed) -> Index:
            return Index(replace(composed, chart=change(composed.chart)))

        forget()
        monkeypatch.setattr(checks, "Index", index)
        return {f"{found.path} [{found.rule}]" for found in check_chart(lifecycle, [mission], catalog)[1]}

    yield told
    forget()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_planted_condition_decides_in_a_proof(kind: type) -> None:
    """What it reads is told apart, and what it compares counts."""
    bare = with_variable(pictured.chart("words"))
    assert "planted" not in Relevance(bare).variables
    chart = planted_in(bare, kind)
    relevance = Relevance(chart)
    assert "planted" in relevance.variables
    read = Compared(World(chart, {}), relevance, 1).read
    assert read is None or ("context", "planted") in read


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_planted_condition_is_no_finding(kind: type, checked: Callable[..., set[str]]) -> None:
    """The mission that says everything is as good as before."""
    words = (WORDS / LIFECYCLE, WORDS / "words.yaml", wide_catalog())
    assert checked(*words, lambda chart: planted_in(with_variable(chart), kind)) == checked(
        *words, lambda c: c
    )


@pytest.mark.parametrize("mission", BROKEN, ids=lambda path: path.stem)
def test_rules_tell_nothing_of_conditions_that_they_do_not_know(
    mission: Path, checked: Callable[..., set[str]], catalog: Catalog
) -> None:
    """Of none is said that it always holds, or never, or together with another one."""

    def change(chart: m.Chart) -> m.Chart:
        return replace(chart, states={name: planted_everywhere(s) for name, s in chart.states.items()})

    found = checked(CHARTS / "mini" / LIFECYCLE, mission, catalog, change)
    assert {one for one in found if one.endswith(tuple(f"[{rule}]" for rule in ASKING))} == set()


def test_a_planted_condition_is_looked_at_again() -> None:
    """By the machine where nothing has happened but what it reads, and by who tells what is possible."""
    chart = with_variable(pictured.chart("words"))
    rule = planted(m.Transition("A.always.1", "", "A", PLACE))
    assert LevelRules(chart, ((rule,),)).reads.parts & CONTEXT
    hold = next(iter(chart.holds.values()))
    changed = replace(chart, holds={**chart.holds, hold.name: planted(hold)})
    assert _reads(changed).parts == _reads(chart).parts | CONTEXT


def test_a_proof_finds_what_a_planted_condition_lets_through(monkeypatch: pytest.MonkeyPatch) -> None:
    """`barred_by: planted` keeps the first from being taken, until the other one makes that false."""
    usual = EvaluationScope.enabled

    def enabled(self: EvaluationScope, offered: Iterable[Any], *now: Any) -> list[m.Transition]:
        def is_barred(rule: m.Transition) -> bool:
            by = getattr(rule, "barred_by", None)
            return by is not None and self.check(by, rule.source, *now)

        return usual(self, [[rule for rule in rules if not is_barred(rule)] for rules in offered], *now)

    monkeypatch.setattr(EvaluationScope, "enabled", enabled)
    states = {
        "A": {
            "on": {
                "operator.dock": "B",
                "operator.skip_current": {"do": ("set", {"planted": False})},
            }
        },
        "B": {},
    }
    bare = with_variable(built(states))
    state = bare.states["A"]
    rules = (planted(state.transitions[0]), *state.transitions[1:])
    chart = replace(bare, states={**bare.states, "A": replace(state, transitions=rules)})
    found = explore(SituationExplorer(World(chart, {}), (), Bounds(restarts=False)))
    assert "B" in found.entered
