"""The composed chart as every other room reads it: words, defaults and what is implied."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.expressions.evaluation import UnknownInput
from lupin_engine.chart.model import Chart, Kind
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import Catalog
from lupin_greenhouse.profile import PROFILE

CHARTS = Path(__file__).parents[2] / "charts"
MISSION = """\
mission: M
summary: a mission
initial: A
states:
  A:
    budget: {after: 1 min, code: late, target: B}
    resume_at: B
    history: deep
    entry:
      - set: {reason: a}
      - arm.preset: {name: home}
      - report.clear
    states:
      B: {after: {1 s: done}, on: {operator.dock: {do: [{raise: {event: it.happened}}]}, it.happened: done}}
  C: {paused: true, after: {1 s: A.history}, phase: WAITING}
  D: {type: parallel, states: {E: {after: {1 s: C}}, F: {}}}
  done: {type: final}
on: {operator.skip_current: C, operator.resume: D}
"""


@pytest.fixture
def chart(tmp_path: Path, catalog: Catalog) -> Chart:
    """A chart with some of everything."""
    (tmp_path / "m.yaml").write_text(MISSION, encoding="utf-8")
    return load_chart(CHARTS / "mini" / LIFECYCLE, [tmp_path / "m.yaml"], catalog)


def test_the_kinds_of_states_are_called_as_in_scxml() -> None:
    """They stand in messages, pictures and journals."""
    assert [kind.value for kind in Kind] == ["atomic", "compound", "parallel", "final", "history"]


def test_the_requests_are_those_of_the_operators_services() -> None:
    """Starting a mission, and six of the operator's."""
    assert [word.rpartition(".")[0] for word in PROFILE.events] == ["mission", *["operator"] * 6]
    assert set(PROFILE.requests) == {"abort", "dock", "pause", "reset", "resume", "skip_current"}


def test_an_unknown_input_is_called_by_its_name() -> None:
    """Its name is the author's."""
    problem = UnknownInput("pose")
    assert (str(problem), problem.name) == ("input.pose is unknown", "pose")


def test_a_state_knows_what_is_around_it(chart: Chart) -> None:
    """Itself first, then what is around it, the root last."""
    assert chart.lineage["MISSION.M.A.B"] == ("MISSION.M.A.B", "MISSION.M.A", "MISSION.M", "MISSION", "")
    assert chart.lineage[""] == ("",)
    assert chart.states["MISSION.M.A.B"].local_name == "B"


def test_what_is_not_written_is_not_there(chart: Chart) -> None:
    """A wrapper and an implied history say nothing of their own; neither do transitions that are implied."""
    wrapper, history = chart.states["MISSION.M"], chart.states["MISSION.M.A.history"]
    assert (wrapper.summary, wrapper.paused, wrapper.phase, wrapper.mission) == (
        "a mission",
        False,
        None,
        "M",
    )
    assert (history.summary, history.paused, history.slot, history.mission) == ("", False, False, "M")
    assert (history.kind, history.depth, history.initial, history.entry) == (Kind.HISTORY, None, None, ())
    budget = next(t for t in chart.states["MISSION.M.A"].transitions if t.event == "budget")
    assert (budget.internal, budget.during, budget.refuse) == (False, frozenset(), None)
    (resume,) = chart.states["MISSION.M.A"].resume_at
    assert (resume.internal, resume.target) == (False, "MISSION.M.A.B")
    assert {name for name, state in chart.states.items() if state.slot} == {"MISSION"}
    assert {name for name, state in chart.states.items() if state.paused} == {"MISSION.M.C"}
    assert {state.phase for state in chart.states.values()} == {None, "WAITING"}


def test_only_what_moves_the_robot_is_kept_back(chart: Chart) -> None:
    """The engine's own actions move nothing."""
    entry = chart.states["MISSION.M.A"].entry
    assert [(call.name, call.moves) for call in entry] == [
        ("set", False),
        ("arm.preset", True),
        ("report.clear", False),
    ]
    (raised,) = chart.states["MISSION.M.A.B"].transitions[0].actions
    assert (raised.name, raised.moves) == ("raise", False)


def test_a_chart_of_one_mission_begins_with_it(chart: Chart) -> None:
    """Children are in the order of the file, regions without the first."""
    slot, both = chart.states["MISSION"], chart.states["MISSION.M.D"]
    assert (slot.initial, slot.children, slot.label) == ("MISSION.M", ("MISSION.M",), "")
    assert (both.initial, both.children) == (None, ("MISSION.M.D.E", "MISSION.M.D.F"))
    assert [chart.states[f"MISSION.M.{name}"].label for name in ("A", "A.B", "D.E")] == ["A", "A", "D"]


@pytest.mark.parametrize(
    ("states", "plugins"),
    [
        ("A: {after: {1 s: done}}", ()),
        ("A: {entry: [{arm.preset: {name: x}}], after: {1 s: done}}", ("arm",)),
        ("A: {exit: [{arm.preset: {name: x}}], after: {1 s: done}}", ("arm",)),
        ("A: {after: {1 s: {target: done, do: [{arm.preset: {name: x}}]}}}", ("arm",)),
        (
            "A: {for_each: {item: x, in: [], key: '${ x }', invoke: {do: nav.localize, "
            "with: {max_variance: 1}, timeout: {after: 1 s, code: late}}, "
            "on_error: {do: [{arm.preset: {name: x}}]}}, after: {1 s: done}}",
            ("arm", "nav"),
        ),
        ("A: {after: {1 s: {target: done, guard: len(tags.numeric_order()) > 1}, 2 s: done}}", ()),
        (
            "A: {after: {1 s: {target: done, guard: home_pose(param.dock_pose).x > '1 m'}, 2 s: done}}",
            ("nav",),
        ),
        ("A: {after: {1 s: {target: done, guard: param.dock_pose.x > '1 m'}, 2 s: done}}", ("nav",)),
        ("A: {on: {nav.blocked: done}, after: {1 s: done}}", ("nav",)),
    ],
)
def test_a_plugin_is_needed_by_whatever_is_used_of_it(
    states: str, plugins: tuple[str, ...], tmp_path: Path, catalog: Catalog
) -> None:
    """Functions, parameters, types, values, events, operations, actions; the lifecycle needs the bridge."""
    text = f"mission: M\nstates:\n  {states}\n  done: {{type: final}}\n"
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    chart = load_chart(CHARTS / "mini" / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert set(chart.plugins) == {"bridge", *plugins}
    assert list(chart.plugins) == sorted(chart.plugins)
