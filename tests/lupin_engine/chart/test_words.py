"""Every word of the language: it can be written, it is typed, and becomes a piece of the composed chart."""

from __future__ import annotations

import random
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.documents import KINDS
from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, ForEach, Invoke, Kind, Level, State
from lupin_engine.chart.nodes import Node
from lupin_engine.chart.source import read
from lupin_engine.chart.validation import read_document
from lupin_engine.errors import Severity
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart, load_chart
from lupin_engine.plugin.contract import Argument, Function, LiveValue, Operation
from lupin_engine.plugin.registry import Catalog, build_catalog
from lupin_engine.plugin.types import LENGTH, POSE, list_of
from lupin_greenhouse.profile import PROFILE
from tests import shipped
from tests.lupin_engine.chart.conftest import ARM, BRIDGE, NAV, PERCEPTION, TAG
from tests.lupin_engine.chart.test_documents import all_models
from tests.lupin_engine.missions.test_load import damaged

GOOD = Path(__file__).parents[2] / "charts" / "good"
WORDS = GOOD / "words"
MISSIONS = Path(__file__).parents[3] / "missions"

DISTANCE = Function(
    "How far apart two poses are.",
    LENGTH,
    lambda _: lambda first, second: abs(first["x"] - second["x"]),
    {"first": Argument(POSE, "from"), "second": Argument(POSE, "to")},
)


def wide_catalog() -> Catalog:
    """The made-up plugins with what a search needs beside."""
    nav = replace(
        NAV,
        operations={
            **NAV.operations,
            "choose_frontier": Operation("Choose where to look next.", result={"pose": POSE}),
        },
        functions={**NAV.functions, "distance": DISTANCE},
    )
    perception = replace(
        PERCEPTION, values={"tags.discovered": LiveValue("Tags that were seen.", list_of(TAG))}
    )
    return build_catalog([nav, BRIDGE, perception, ARM], [PROFILE])


@pytest.fixture(scope="module")
def wide() -> Catalog:
    """What a search needs."""
    return wide_catalog()


@pytest.fixture(scope="module")
def words(wide: Catalog) -> Chart:
    """The mission that says everything."""
    chart, found = check_chart(WORDS / LIFECYCLE, [WORDS / "words.yaml"], wide)
    assert found == ()
    assert chart is not None
    return chart


def state(chart: Chart, name: str) -> State:
    """A state of the mission."""
    return chart.states[f"MISSION.Words.{name}"]


def shown(value: Any) -> Any:
    """A value as it is written."""
    return value.source if isinstance(value, Expression) else value.value


# -- the good charts say every word ------------------------------------------------------------------------


def key(model: type[Node], name: str) -> tuple[str, str]:
    """A key of the language, by the most general model that has it."""
    owners = [base for base in model.__mro__ if issubclass(base, Node) and name in base.model_fields]
    return owners[-1].__name__, name


def keys_said(value: Any) -> set[tuple[str, str]]:
    """Every key that is written in what was read."""
    if isinstance(value, Node):
        own = {key(type(value), name) for name in value.model_fields_set}
        return own.union(*(keys_said(getattr(value, name)) for name in value.model_fields_set))
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return set().union(*(keys_said(element) for element in inner))


def test_every_key_of_the_language_is_said() -> None:
    """A word that no good chart says is a word that nobody has seen loading."""
    findings, written = Findings(), set[tuple[str, str]]()
    for kind, path in (("lifecycle", LIFECYCLE), ("mission", "words.yaml"), ("part", "parts/walk.yaml")):
        raw = read(WORDS / path, findings)
        assert raw is not None
        written |= keys_said(read_document(raw, KINDS[kind], findings))
    assert findings.all == ()
    written |= {("StateNode", "sequence"), ("StateNode", "times")}  # they become states: test_sequences
    written.add(("LifecycleNode", "extends"))  # it is merged before it is read: test_extended
    assert {key(model, name) for model in all_models() for name in model.model_fields} - written == set()


def test_the_shipped_exploration_is_a_good_chart() -> None:
    """With the installed plugins: no error and no warning."""
    mission = MISSIONS / "exploration.yaml"
    chart, found = check_chart(MISSIONS / LIFECYCLE, [mission], shipped.catalog())
    assert found == ()
    assert chart is not None
    exploring = chart.states["MISSION.ExplorationMission.EXPLORING"]
    assert exploring.budget is not None
    assert [t.event for t in exploring.transitions] == ["", "budget"]
    assert chart.states[f"{exploring.name}.SEED_CLIMATE"].for_each is not None
    assert chart.plugins == ("arm", "bridge", "nav", "perception")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_no_damage_to_a_word_becomes_a_traceback(seed: int, tmp_path: Path, wide: Catalog) -> None:
    """Whatever is in the files: a chart, or findings that say where."""
    chance = random.Random(seed)
    shutil.copytree(WORDS, tmp_path, dirs_exist_ok=True)
    path = chance.choice(sorted(tmp_path.rglob("*.yaml")))
    path.write_text(damaged(path.read_text(), chance))
    chart, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "words.yaml"], wide)
    assert chart is not None or any(d.severity is Severity.ERROR for d in found)


# -- what becomes of them ----------------------------------------------------------------------------------


def test_a_budget_is_a_timer_and_a_transition(words: Chart) -> None:
    """Both stand where it is written; the time has a unit."""
    starting = state(words, "STARTING")
    assert starting.budget is not None
    assert (starting.budget.event, shown(starting.budget.due)) == ("budget", "param.patience * 10")
    assert starting.budget.due.type.unit == "s"
    assert starting.budget.due.evaluate({"param": {"patience": 3.0}}) == 30.0
    (rule,) = (t for t in starting.transitions if t.event == "budget")
    assert rule.id == "MISSION.Words.STARTING.budget"
    assert (rule.source, rule.target, rule.code) == (starting.name, "MISSION.Words.BOTH", "slow")
    (choice,) = rule.actions
    assert choice.guard is not None
    assert (choice.name, choice.guard.source, choice.arguments) == ("if", "reason == ''", {})
    assert [action.name for action in choice.then] == ["set"]
    (inner,) = choice.otherwise
    assert [action.name for action in (*inner.then, *inner.otherwise)] == ["report.clear"]
    assert rule.place == starting.budget.place
    assert rule.place.line == starting.place.line + 4
    assert state(words, "BOTH").budget is None


def test_a_state_around_others_may_invoke(words: Chart) -> None:
    """Its ends belong to the operation; also around regions."""
    starting, both = state(words, "STARTING"), state(words, "BOTH")
    assert (starting.kind, both.kind) == (Kind.COMPOUND, Kind.PARALLEL)
    assert isinstance(starting.invoke, Invoke)
    assert both.invoke is not None
    assert both.invoke.timeout is None
    events = [(t.event, t.target) for t in both.transitions]
    assert ("done", "MISSION.Words.TOURING") in events


def test_a_retry_has_factor_and_jitter(words: Chart) -> None:
    """Constants without a unit; a share may be written in percent."""
    invoke = state(words, "STARTING").invoke
    assert invoke is not None
    assert invoke.retry is not None
    assert isinstance(invoke.retry.factor, Constant)
    assert isinstance(invoke.retry.jitter, Constant)
    assert (invoke.retry.factor.value, invoke.retry.jitter.value) == (2.0, 0.2)
    assert invoke.retry.unless == {"late"}


def every(words: Chart) -> ForEach:
    """The for_each of the mission."""
    found = state(words, "BOTH.READING").for_each
    assert found is not None
    return found


def test_a_for_each_calls_its_element_by_the_authors_name(words: Chart) -> None:
    """Whatever the name, expressions read the environment's `item`."""
    found = every(words)
    env = {
        "item": {"id": "T1", "x": 2.0, "y": 0.0},
        "param": {"patience": 9.0},
        "context": {"tag": None, "read": 1},
        "request": {"rounds": 3},
        "event": {"reading": {"t": 20}},
        "error": {"code": "late", "detail": ""},
    }
    assert found.name == "tag"
    assert (shown(found.items), shown(found.key)) == ("request.tags", "tag.id")
    assert found.items.type.item == TAG
    assert found.key.evaluate(env) == "T1"
    assert found.limit is not None
    assert found.limit.evaluate(env) == 6
    assert found.when is not None
    assert found.when.evaluate(env) is True
    assert found.invoke.name == "bridge.read_tag"
    assert found.invoke.arguments["tag_id"].evaluate(env) == "T1"
    assert found.invoke.timeout is not None
    assert found.invoke.timeout.evaluate(env) == 5.0
    assert found.invoke.timeout_code == "late"
    publish, count = found.on_done
    assert {name: value.evaluate(env) for name, value in publish.arguments.items()} == {
        "tag": "T1",
        "reading": {"t": 20},
    }
    assert count.arguments["read"].evaluate(env) == 2
    noted, raised = found.on_error
    assert noted.arguments["reason"].evaluate(env) == "late"
    assert raised.name == "raise"
    assert found.place.line == state(words, "BOTH.READING").place.line + 2


def test_the_operation_for_each_element_counts_as_used(words: Chart) -> None:
    """Its plugin is waited for, its codes have labels, what its actions raise can be listened to."""
    assert "bridge" in words.plugins
    assert words.codes["bridge_error"].label == "bridge error"
    assert "seen.something" in [t.event for t in state(words, "BOTH").transitions]
    assert state(words, "BOTH.READING").invoke is None


def test_an_itinerary_has_an_order_and_sweeps(words: Chart) -> None:
    """The order is asked for each target, and is a number in any unit."""
    itinerary = state(words, "TOURING").itinerary
    assert itinerary is not None
    assert itinerary.order is not None
    assert itinerary.order.type == LENGTH
    env = {
        "input": {"pose": {"x": 5.0}},
        "target": {"x": 2.0},
        "functions": {"approach": lambda target: target, "distance": DISTANCE.bind({})},
        "request": {"rounds": 2},
    }
    assert itinerary.order.evaluate(env) == 3.0
    assert itinerary.sweeps is not None
    assert itinerary.sweeps.evaluate(env) == 2
    assert itinerary.leaves_open


def test_an_itinerary_is_walked_once_in_its_own_order_when_nothing_is_said(wide: Catalog) -> None:
    """As before there were these words."""
    chart = load_chart(GOOD.parent / "mini" / LIFECYCLE, [GOOD / "tours.yaml"], wide)
    itinerary = chart.states["MISSION.Tours.TOURING"].itinerary
    assert itinerary is not None
    assert (itinerary.order, itinerary.sweeps, itinerary.leaves_open) == (None, None, False)


def test_inputs_have_a_range_and_an_age(words: Chart) -> None:
    """In base units."""
    battery, pose = words.inputs["battery"], words.inputs["pose"]
    assert (battery.minimum, battery.maximum, battery.of_mission) == (0.0, 1.0, False)
    assert (pose.minimum, pose.maximum, pose.of_mission) == (None, None, True)


def test_what_a_proof_tries_as_well_is_read(words: Chart) -> None:
    """In base units."""
    assert words.inputs["battery"].classes == (0.07,)
    invokes = [state.invoke for state in words.states.values() if state.invoke is not None]
    assert [one.classes for one in invokes if one.name == "nav.measure"] == [({"m": 0.2},)]


def test_a_level_lies_below_or_above(words: Chart) -> None:
    """Exactly one of the two."""

    def limits(level: Level) -> tuple[Any, ...]:
        return tuple(value and shown(value) for value in (level.below, level.above, level.hysteresis))

    assert {level.name: limits(level) for level in words.inputs["battery"].levels} == {
        "low": (0.2, None, 0.05),
        "full": (None, 0.9, 0.02),
    }


def test_invariants_of_all_files_are_the_charts(words: Chart) -> None:
    """By name, in the order of the files."""
    assert list(words.invariants) == ["still_while_stopped", "kept", "counted", "charged"]
    counted = words.invariants["counted"]
    assert (counted.that.source, counted.summary) == ("read >= 0", "a count does not go below nothing")
    assert counted.that.evaluate({"context": {"read": -1}}) is False
    still = words.invariants["still_while_stopped"]
    assert still.that.evaluate({"input": {"estop": True}, "held": lambda name: name == "estop"}) is True
    assert still.place.file.endswith(LIFECYCLE)


def test_plugins_tell_of_events(words: Chart) -> None:
    """By full name, by prefix, or any; the first is typed."""
    resting = {t.event: t for t in state(words, "STARTING.RESTING").transitions}
    guard = resting["nav.blocked"].guard
    assert guard is not None
    assert guard.evaluate({"event": {"seconds": 4.0, "where": {"x": 0.5}}}) is True
    assert resting["*"].internal
    assert [t.event for t in words.states[""].transitions] == ["nav.*"]


def test_the_plugin_of_an_event_is_used(tmp_path: Path, catalog: Catalog) -> None:
    """It must be running for its event to come; listening to anything asks for nobody."""
    shutil.copy(GOOD.parent / "mini" / LIFECYCLE, tmp_path)
    for event, plugins in (
        ("nav.blocked", ("bridge", "nav")),
        ("nav.*", ("bridge", "nav")),
        ("'*'", ("bridge",)),
    ):
        mission = tmp_path / "m.yaml"
        mission.write_text(f"mission: M\nstates: {{A: {{on: {{{event}: done}}}}, done: {{type: final}}}}\n")
        assert load_chart(tmp_path / LIFECYCLE, [mission], catalog).plugins == plugins


def test_an_error_knows_its_codes(words: Chart) -> None:
    """They belong to the type of what the guard compares."""
    rules = [t for t in state(words, "STARTING").transitions if t.event == "error"]
    assert rules[0].guard is not None
    assert rules[0].guard.evaluate({"error": {"code": "late"}}) is True
    assert every(words).on_error[0].arguments["reason"].type.values == (
        "bridge_error",
        "driver_error",
        "execution_error",
        "late",
        "operation_cancelled",
    )
