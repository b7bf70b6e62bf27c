"""What an author says of every run: judged step by step, in missions and in scenarios."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.compose.timeless import WATCHED_ALWAYS
from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.model import TemporalProperty
from lupin_engine.errors import ChartError
from lupin_engine.missions.folders import lifecycle_of
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.types import DURATION
from lupin_engine.properties.authored import properties_of, sentence, watched
from lupin_engine.properties.built_in import BUILT_IN, STANDSTILL, Glance, Passage, Verdict, due
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scenario import load_scenario
from lupin_verify.outcomes import OUTCOMES
from lupin_verify.proof import ProofVerdict, prove
from lupin_verify.situations.explorer import NO_EXCEPTION, Bounds
from lupin_verify.situations.graph import OF_THE_GRAPH
from tests import shipped
from tests.lupin_engine.machine.charts import PLACE, Bench, chart, expression, fails

#: Says of a variable that it has one of the values.
NUMBER = {"A": {"on": {"set": {"do": ("set", {"n": lambda env: env["event"]["to"]})}}}, "FAULT": {}}


def n(*values: int) -> Any:
    """Return the condition that n is one of some values."""
    return expression(lambda env: env["context"]["n"] in values, f"n in {values}")


def judged(rule: TemporalProperty, *happened: tuple[float, int], until: float = 0.0) -> list[str]:
    """Return what is said step by step (`-` not about it, `+` holds, else the breach), and at the end."""
    watcher, bench = watched(rule), Bench(chart(NUMBER, context={"n": 0}))
    state, said, verdict = watcher.first, [], Verdict(False)
    for time, number in ((0.0, 0), *happened):
        bench.now = time
        step = bench.send("set", to=number)
        state, verdict = watcher.watch(state, Passage(Glance(), step, bench.machine.scope))
        said.append(shown(verdict))
    return [*said, shown(watcher.end(state, until))] if until else said


def shown(verdict: Verdict) -> str:
    """Return a verdict as a word."""
    return verdict.breach or ("+" if verdict.relevant else "-")


def test_always_and_never() -> None:
    """From the first step on, or between two moments; what cannot be worked out does not hold."""
    broken = "property p (line 1): n in (0, 1) became false; it must always be true"
    assert judged(TemporalProperty("p", PLACE, always=n(0, 1)), (1.0, 1), (2.0, 2)) == ["+", "+", broken]
    asked = TemporalProperty("p", PLACE, never=n(5), after=n(1), until=n(2))
    seen = judged(asked, (1.0, 5), (2.0, 1), (3.0, 3), (4.0, 2), (5.0, 5), (6.0, 1), (7.0, 5))
    never = "property p (line 1): n in (5,) became true; it must never be"
    assert seen == ["-", "-", "+", "+", "-", "-", "+", never]
    assert judged(TemporalProperty("p", PLACE, always=expression(fails, "n"))) == [
        "property p (line 1): n could not be evaluated: division by zero"
    ]
    assert judged(TemporalProperty("p", PLACE, never=expression(fails, "n"))) == ["+"]


def test_eventually() -> None:
    """In time, too late, ended by `until`, or open at the end: only what was due by then is too late."""
    ten = Constant(10.0, PLACE, DURATION)
    late = "property p (line 1): n in (2,) did not become true within 10 s"
    comes = TemporalProperty("p", PLACE, eventually=n(2), within=ten, after=n(1), until=n(3))
    assert judged(comes, (1.0, 1), (5.0, 4), (11.0, 2), (12.0, 4)) == ["-", "+", "+", "+", "-"]
    assert judged(comes, (1.0, 1), (5.0, 4), (11.5, 2)) == ["-", "+", "+", late]
    assert judged(comes, (1.0, 1), (5.0, 3), (50.0, 4)) == ["-", "+", "-", "-"]
    assert judged(comes, (1.0, 1), until=11.0) == ["-", "+", "-"]
    assert judged(comes, (1.0, 1), until=11.5) == ["-", "+", late]
    once = TemporalProperty("p", PLACE, eventually=n(2), within=ten)
    assert judged(once, (5.0, 2), (50.0, 4), until=90.0) == ["+", "+", "-", "-"]


def test_what_is_remembered_is_times() -> None:
    """So that states can be compared, and moved to another time."""
    watcher = watched(TemporalProperty("p", PLACE, eventually=n(2), within=Constant(10.0, PLACE, DURATION)))
    bench = Bench(chart(NUMBER, context={"n": 0}))
    bench.now = 3.0
    state, _ = watcher.watch(watcher.first, Passage(Glance(), bench.send("set", to=1), bench.machine.scope))
    assert (watcher.first, state, due(state)) == ((), (13.0,), 13.0)
    state, _ = watcher.watch(state, Passage(Glance(), bench.send("set", to=2), bench.machine.scope))
    assert due(state) == math.inf


def test_they_are_told_in_a_sentence() -> None:
    """The author's own, or the words with their conditions."""
    rule = TemporalProperty("p", PLACE, never=n(5), after=n(1), until=n(2))
    assert sentence(rule) == "after n in (1,): never n in (5,), until n in (2,)"
    ten = Constant(10.0, PLACE, DURATION)
    comes = TemporalProperty("p", PLACE, eventually=n(2), within=ten, after=n(1))
    assert sentence(comes) == "after n in (1,): eventually n in (2,) within 10 s"
    written = TemporalProperty("p", PLACE, eventually=n(2), within=expression(lambda _: 10.0, "param.soon"))
    assert sentence(written) == "eventually n in (2,) within param.soon"
    assert watched(TemporalProperty("p", PLACE, always=n(5), summary="Five.")).says == "Five."
    assert [one.name for one in properties_of(chart(NUMBER), {"p": rule})][-1] == "p"


def test_the_names_of_the_others_are_taken() -> None:
    """The checker knows them, though it stands below what watches them."""
    every = {one.name for one in (*BUILT_IN, *OF_THE_GRAPH)} | {NO_EXCEPTION, STANDSTILL, OUTCOMES}
    assert every == WATCHED_ALWAYS


SCENARIO = """\
scenario: a stop on the way
mission: inspection
request: {tag_sequence: ["1"]}
properties:
  halts: {never: in_state('DRIVING'), after: input.estop, until: not input.estop}
  comes_home: {eventually: in_state('DONE'), within: 20 s, after: in_state('RETURNING')}
when:
  - {on: DRIVING, after: 1 s, value: {estop: true}}
  - {on: DRIVING, after: 5 s, value: {estop: false}}
  - {on: DRIVING, after: 9 s, request: operator.resume}
expect: {final: DONE}
"""


def failures(folder: Path, text: str) -> list[str]:
    """Return what a scenario says that has this text."""
    file = folder / "one.scenario.yaml"
    file.write_text(text, encoding="utf-8")
    scenario = load_scenario(file, shipped.catalog())
    found = scenario.failures(scenario.run())
    return [f"{one.what}: {one.expected} / {one.actual}" for one in found]


def test_time_goes_on_where_nobody_does_anything_any_more(tmp_path: Path) -> None:
    """The stop stays pressed, so the robot never comes home; that ends no sooner than the time for it."""
    text = SCENARIO.split("  halts:")[0] + PRESSED
    how = "property comes_home (line 5): in_state('DONE') did not become true within 20 s"
    assert failures(tmp_path, text) == [f"violated: comes_home: it holds / {how}"]


#: The end of a scenario.
PRESSED = """\
  comes_home: {eventually: in_state('DONE'), within: 20 s, after: input.estop}
when:
  - {on: DRIVING, after: 1 s, value: {estop: true}}
expect: {final: INSPECTING}
"""


def test_a_scenario_watches_its_own_and_all_others(tmp_path: Path) -> None:
    """What is violated fails it, unless it says so; what it says and is not so fails as well."""
    how = "property halts (line 5): in_state('DRIVING') became true; it must never be"
    assert failures(tmp_path, SCENARIO) == [f"violated: halts: it holds / {how}"]
    expected = SCENARIO.replace("DONE}\n", "DONE, violated: [halts]}\n")
    assert failures(tmp_path, expected) == []
    wrong = expected.replace("[halts]", "[halts, comes_home]")
    assert failures(tmp_path, wrong) == ["violated: comes_home / they hold"]


def test_a_scenario_tells_what_is_wrong_with_them(tmp_path: Path) -> None:
    """As a mission does, with the place."""
    text = SCENARIO.replace("input.estop, until", "input.stop, until").replace(
        "DONE}\n", "DONE, violated: [halt]}\n"
    )
    with pytest.raises(ChartError) as caught:
        failures(tmp_path, text)
    assert str(caught.value).replace(f"{tmp_path}/one.scenario.yaml:", "").splitlines() == [
        "5:52: error: properties.halts.after: 'input' has no 'stop'; did you mean 'estop'? [unknown-name]",
        "11:34: error: expect.violated: unknown property 'halt'; did you mean 'halts'? [unknown-name]",
    ]


#: Rests where that was asked for.
WAITS = """\
mission: Waits
request: {slowly: {type: bool, default: false}}
properties:
  only_slowly: {never: "in_state('RESTING') and not request.slowly"}
initial: GOING
states:
  GOING: {after: {2 s: [{target: RESTING, guard: request.slowly}, {target: done}]}}
  RESTING: {after: {5 s: done}}
  done: {type: final}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("guard", "broken"), [("request.slowly", False), ("not request.slowly", True)])
def test_a_property_reads_the_request(guard: str, broken: bool, tmp_path: Path) -> None:
    """It is about the runs of its mission; a proof keeps apart what it reads, and its scenario fails."""
    mission = tmp_path / "waits.yaml"
    mission.write_text(WAITS.replace("guard: request.slowly", f"guard: {guard}"), encoding="utf-8")
    chart = load_chart(lifecycle_of(mission), [mission], shipped.catalog())
    assert chart.properties["only_slowly"].mission == "Waits"
    proof = prove(make_world(chart, {}), Bounds(targets=0, restarts=False))
    (found,) = [one for one in proof.properties if one.name == "only_slowly"]
    assert (found.verdict is ProofVerdict.BROKEN) == broken
    scenario = tmp_path / "rest.scenario.yaml"
    scenario.write_text(
        "scenario: it rests or not\nmission: waits.yaml\nrequest: {slowly: false}\n"
        "properties: {also: {never: \"in_state('RESTING') and not request.slowly\"}}\n"
        "expect: {}\n",
        encoding="utf-8",
    )
    run = load_scenario(scenario, shipped.catalog()).run()
    assert {name for _, name, _ in run.violated} == ({"only_slowly", "also"} if broken else set())


#: Goes from place to place, or leaves the second one out.
TOURS = """\
mission: Tours
request: {whole: {type: bool, default: true}}
initial: HALL
states:
  HALL: {after: {2 s: DOOR}}
  DOOR: {after: {2 s: [{target: WINDOW, guard: request.whole}, {target: ROOF}]}}
  WINDOW: {after: {2 s: ROOF}}
  ROOF: {after: {2 s: done}}
  done: {type: final}
"""
#: A tour is aborted at the door; a second one is made.
TWO_TOURS = """\
scenario: two tours
mission: tours.yaml
request: {whole: WHOLE}
properties:
  tour: {PATTERN}
when:
  - {on: DOOR, after: 1 s, request: operator.abort}
  - {on: DONE, after: 1 s, request: {mission.start: {whole: WHOLE}}}
limit: 40 s
expect: {final: DONE}
"""
IN_ORDER = "visit_in_order: [in_state('HALL'), in_state('WINDOW'), in_state('ROOF')]"
AVOIDED = "never: in_state('ROOF'), until: in_state('WINDOW')"
IN_TIME = "eventually: in_state('ROOF'), within: 5 s, until: in_state('RETURNING')"
NEVER_THERE = "the mission is done, but in_state('WINDOW') never became true"


@pytest.mark.parametrize(
    ("pattern", "whole", "broken"),
    [
        ("visit_all: [in_state('ROOF'), in_state('WINDOW')]", True, ""),
        ("visit_all: [in_state('ROOF'), in_state('WINDOW')]", False, NEVER_THERE),
        ("visit_all: [in_state('WINDOW')], until: in_state('ROOF')", False, ""),
        (IN_ORDER, True, ""),
        (IN_ORDER, False, "in_state('ROOF') became true, but in_state('WINDOW') had not yet"),
        ("visit_in_order: [in_state('DOOR'), in_state('WINDOW')]", False, NEVER_THERE),
        (AVOIDED, True, ""),
        (AVOIDED, False, "in_state('ROOF') became true; it must never be"),
        ("always: not in_state('DOOR'), until: in_state('HALL')", False, ""),
        (IN_TIME, False, ""),
        (IN_TIME, True, "in_state('ROOF') did not become true within 5 s"),
    ],
)
def test_a_pattern_begins_anew_with_each_mission(
    pattern: str, whole: bool, broken: str, tmp_path: Path
) -> None:
    """An aborted one owes no places, and leaves none to the next one."""
    (tmp_path / "tours.yaml").write_text(TOURS, encoding="utf-8")
    text = TWO_TOURS.replace("{PATTERN}", f"{{{pattern}}}").replace("WHOLE", str(whole).lower())
    how = f"violated: tour: it holds / property tour (line 5): {broken}"
    assert failures(tmp_path, text) == ([how] if broken else [])


def test_patterns_are_told_in_a_sentence() -> None:
    """With their places, and from when on."""
    rule = TemporalProperty("p", PLACE, visit_all={"a": n(1), "b": n(2)}, until=n(3), mission="M")
    assert sentence(rule) == "before the mission is done: a, b, until n in (3,)"
    rule = TemporalProperty("p", PLACE, visit_in_order={"a": n(1), "b": n(2)}, mission="M")
    assert sentence(rule) == "before the mission is done: a, b, in this order"
    rule = TemporalProperty("p", PLACE, never=n(1), until=n(2))
    assert sentence(rule) == "from the start of a mission: never n in (1,), until n in (2,)"
