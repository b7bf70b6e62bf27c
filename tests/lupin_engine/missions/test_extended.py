"""A project's lifecycle extends the shipped one: merged, with the places of both files, and seen as one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.chart.model import Chart, Transition
from lupin_engine.errors import ChartError, Severity, UsageError
from lupin_engine.missions import folders
from lupin_engine.missions.bundle import read_bundle, unpack
from lupin_engine.missions.folders import default_missions_folder, shipped_lifecycles
from lupin_engine.missions.load import check_chart, expanded, inspect_chart, load_chart, load_files
from lupin_engine.plugin.registry import Catalog
from lupin_engine.replay.yaml_text import yaml_text

SHIPPED = default_missions_folder() / "lifecycle.yaml"
WAIT = "mission: Wait\nstates:\n  WAITING: {after: {1 s: done}}\n  done: {type: final}\n"
HEAD = "lifecycle: ward-robot\nextends: greenhouse-robot\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a mission."""
    (tmp_path / "wait.yaml").write_text(WAIT)
    return tmp_path


def written(folder: Path, overrides: str) -> tuple[Path, list[Path]]:
    """Write a lifecycle that overrides something; return it and the missions."""
    lifecycle = folder / "lifecycle.yaml"
    lifecycle.write_text(HEAD + overrides)
    return lifecycle, [folder / "wait.yaml"]


def charted(folder: Path, overrides: str, catalog: Catalog) -> Chart:
    """Return the chart with these overrides, which are right."""
    chart, found = check_chart(*written(folder, overrides), catalog)
    assert found == ()
    assert chart is not None
    return chart


def told(folder: Path, overrides: str, catalog: Catalog) -> list[str]:
    """Return the messages about overrides; SHIPPED stands for a place in the shipped file."""
    found = check_chart(*written(folder, overrides), catalog)[1]
    return [re.sub(rf"{re.escape(str(SHIPPED))}:\d+:\d+", "SHIPPED", one.message) for one in found]


def taken(chart: Chart, state: str, event: str) -> list[Transition]:
    """Return the transitions of a state for an event."""
    return [rule for rule in chart.states[state].transitions if rule.event == event]


def rules_of(chart: Chart) -> list[tuple[str, str, str | None, str]]:
    """Return the transitions of a chart."""
    rules = [rule for state in chart.states.values() for rule in state.transitions]
    return [(rule.id, rule.event, rule.target, rule.guard.source) for rule in rules]


def test_without_an_override_it_is_the_shipped_one(folder: Path, catalog: Catalog) -> None:
    """All but the name and the files."""
    chart = charted(folder, "", catalog)
    shipped = load_chart(SHIPPED, [folder / "wait.yaml"], catalog)
    assert (chart.name, chart.extends) == ("ward-robot", "greenhouse-robot")
    assert rules_of(chart) == rules_of(shipped)
    assert [(one.name, one.place) for one in chart.holds.values()] == [
        (one.name, one.place) for one in shipped.holds.values()
    ]
    assert chart.parameters == shipped.parameters
    assert [*chart.properties] == [*shipped.properties]
    assert chart.files[:2] == chart.lifecycle_files == (str(folder / "lifecycle.yaml"), str(SHIPPED))


def test_names_are_merged_and_values_replace(folder: Path, catalog: Catalog) -> None:
    """One key of a parameter, a code, a transition, an operation; all else stays."""
    overrides = """\
params: {dock_timeout_s: {default: 90 s}}
codes: {mission_failed: {advice: Call the ward.}}
states:
  RETURNING:
    on: {operator.skip_current: DONE}
    states:
      DRIVING_HOME:
        invoke: {timeout: {after: "${ 2 * param.dock_timeout_s }"}}
"""
    chart, shipped = charted(folder, overrides, catalog), load_chart(SHIPPED, [], catalog)
    parameter = chart.parameters["dock_timeout_s"]
    assert (parameter.default, parameter.minimum) == (90.0, 1.0)
    assert chart.parameters["dock_retry_max"] == shipped.parameters["dock_retry_max"]
    code = chart.codes["mission_failed"]
    assert (code.label, code.advice) == ("mission failed", "Call the ward.")
    invoke = chart.states["RETURNING.DRIVING_HOME"].invoke
    assert invoke is not None
    assert invoke.name == "nav.dock"
    assert "2 * param.dock_timeout_s" in str(invoke.timeout)
    assert (invoke.timeout_code, invoke.retry is None) == ("nav_timeout", False)
    assert [rule.target for rule in taken(chart, "RETURNING", "operator.skip_current")] == ["DONE"]
    assert len(taken(chart, "RETURNING", "operator.abort")) == 2


def test_another_operation_is_written_as_a_whole(folder: Path, catalog: Catalog) -> None:
    """Its arguments and limits are its own."""
    overrides = """\
states:
  RETURNING:
    states:
      DRIVING_HOME:
        invoke: {do: nav.localize, with: {max_variance: 1}, timeout: {after: 5 s, code: nav_timeout}}
"""
    chart, found = check_chart(*written(folder, overrides), catalog)
    invoke = chart.states["RETURNING.DRIVING_HOME"].invoke if chart else None
    assert invoke is not None
    assert (invoke.name, invoke.retry) == ("nav.localize", None)
    assert [str(one).removeprefix(str(folder)) for one in found] == [
        f"/lifecycle.yaml:2:10: warning: params.{name}: nothing reads the parameter {name!r} of "
        f"greenhouse-robot any more; let the override read it as param.{name} [unused-parameter]"
        for name in ("dock_retry_max", "dock_timeout_s")
    ]


def test_a_state_of_ones_own(folder: Path, catalog: Catalog) -> None:
    """With a transition to it, and a hold that is the project's."""
    overrides = """\
inputs: {wind: {value: robot.battery, initial: 0, levels: {strong: {above: 0.95}}}}
codes: {windy: {label: too windy}, cleaned: {label: cleaned}}
holds: {wind: {engage: input.wind.strong, release: operator.resume, code: windy}}
states:
  DONE: {after: {5 s: CLEANING}}
  CLEANING: {after: {10 s: {target: READY, code: cleaned, during: wind}}, on: {mission.start: {use: READY}}}
"""
    chart = charted(folder, overrides, catalog)
    assert [*chart.holds] == ["pause", "estop", "wind"]
    assert [rule.during for rule in chart.states["CLEANING"].transitions][-1] == {"wind"}


def test_a_sequence_of_ones_own(folder: Path, catalog: Catalog) -> None:
    """It is written out before the two are merged, with its counter."""
    overrides = """\
states:
  MISSION: {on_done: DISINFECTING}
  DISINFECTING:
    on: {mission.start: {refuse: mission_running}}
    sequence:
      - SPRAYING: {after: {5 s: DISINFECTING.DRYING}}
      - DRYING: {after: {30 s: DISINFECTING.again}}
    times: 2
    on_done: RETURNING
"""
    chart = charted(folder, overrides, catalog)
    assert [name for name in chart.states if name.startswith("DISINFECTING.")] == [
        f"DISINFECTING.{name}" for name in ("begin", "SPRAYING", "DRYING", "again", "over")
    ]
    assert chart.context["disinfecting_round"].type.name == "count"
    assert chart.states["DISINFECTING.again"].transitions[0].place.file == chart.lifecycle_files[0]


def test_every_value_has_the_place_where_it_is_written(folder: Path, catalog: Catalog) -> None:
    """In the project's file what that writes, in the shipped one all else."""
    chart = charted(folder, "states:\n  RETURNING:\n    on: {operator.skip_current: DONE}\n", catalog)
    own, shipped = chart.lifecycle_files
    (skip,) = taken(chart, "RETURNING", "operator.skip_current")
    assert skip.place == (own, 5, 33)
    assert {rule.place.file for rule in taken(chart, "RETURNING", "operator.abort")} == {shipped}
    assert chart.states["RETURNING"].place == (own, 4, 3)
    assert chart.states["RETURNING.DOCKED"].place.file == shipped
    assert chart.file_of(skip.place) == "lifecycle.yaml"
    assert chart.file_of(chart.states["BOOT"].place) == "greenhouse-robot"


def test_a_mistake_in_an_override_is_told_at_its_place(folder: Path, catalog: Catalog) -> None:
    """By the rules of every lifecycle; what follows in the shipped file is told there."""
    lifecycle, missions = written(folder, "states:\n  RETURNING:\n    on: {operator.dock: HOME}\n")
    (one,) = inspect_chart(lifecycle, missions, catalog).found
    assert str(one) == (
        f"{lifecycle}:5:25: error: RETURNING.on.operator.dock: no state is called 'HOME' here; allowed: "
        "'BOOT', 'DOCKED', 'DONE', 'DRIVING_HOME', 'FAULT', 'MISSION', 'READY', 'RETURNING' [unknown-state]"
    )


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        (
            "states:\n  RETURNING: {initial: DOCKED}\n",
            "RETURNING.DRIVING_HOME: no way leads to this state; add a transition to it, or remove it; "
            "look at the override in OWN:4:3",
        ),
        (
            "params:\n  dock_timeout_s: {min: 2 min}\n",
            "params.dock_timeout_s: the default is below the minimum of 2 min; "
            "look at the override in OWN:4:3",
        ),
    ],
)
def test_what_an_override_breaks_in_the_shipped_file(
    overrides: str, text: str, folder: Path, catalog: Catalog
) -> None:
    """It is reported there, with the place of the override."""
    (one,) = told(folder, overrides, catalog)
    assert one.replace(str(folder / "lifecycle.yaml"), "OWN") == text


def test_what_a_warning_accepts_is_read_in_both_files(folder: Path, catalog: Catalog) -> None:
    """An override that is the same is a warning, which can be accepted where it stands."""
    line = "params: {dock_retry_max: {default: 3}}"
    overrides = f"{line}  # accept overrides-nothing: we want to see it\n"
    (one,) = check_chart(*written(folder, overrides), catalog)[1]
    assert one.severity is Severity.INFO
    assert told(folder, f"{line}\n", catalog) == [
        "params.dock_retry_max.default: this is the same as in greenhouse-robot, SHIPPED; remove it"
    ]


def test_an_unknown_lifecycle_is_answered_with_the_shipped_ones(folder: Path, catalog: Catalog) -> None:
    """The nearest, or all that there are."""
    lifecycle = folder / "lifecycle.yaml"
    for name, hint in (
        ("greenhous-robot", "did you mean 'greenhouse-robot'?"),
        ("x", "allowed: 'greenhouse-robot'"),
        ("../x", "allowed: 'greenhouse-robot'"),
    ):
        lifecycle.write_text(f"lifecycle: a\nextends: {name}\n")
        (one,) = check_chart(lifecycle, [], catalog)[1]
        problem = f"extends: unknown shipped lifecycle {name!r}; {hint}"
        assert str(one) == f"{lifecycle}:2:10: error: {problem} [unknown-lifecycle]"


def test_a_lifecycle_does_not_extend_itself(folder: Path, catalog: Catalog) -> None:
    """Nor one that extends another: both are said to be no complete one."""
    lifecycle = folder / "extends" / "a.yaml"
    lifecycle.parent.mkdir()
    for text in ("lifecycle: a\nextends: a\n", f"{HEAD}"):
        lifecycle.write_text(text)
        (folder / "lifecycle.yaml").write_text("lifecycle: b\nextends: a\n")
        (one,) = check_chart(folder / "lifecycle.yaml", [], catalog)[1]
        assert one.message == (
            f"extends: 'a' extends a lifecycle itself, in {lifecycle}:2:1; extend one that is complete: "
            "a lifecycle is read in two files at most"
        )


@pytest.mark.parametrize("name", ["3", "[a]", "", "true"])
def test_what_is_no_name_is_told(name: str, folder: Path, catalog: Catalog) -> None:
    """No traceback."""
    lifecycle = folder / "lifecycle.yaml"
    lifecycle.write_text(f"lifecycle: a\nextends: {name}\n")
    assert check_chart(lifecycle, [], catalog)[1]


def test_a_file_that_is_no_lifecycle_extends_none(folder: Path, catalog: Catalog) -> None:
    """The name of the lifecycle is written, too."""
    lifecycle = folder / "lifecycle.yaml"
    lifecycle.write_text("extends: greenhouse-robot\n")
    assert [one.problem for one in check_chart(lifecycle, [], catalog)[1]] == [
        "expected a lifecycle, but the file does not say what it is"
    ]


def test_a_start_may_be_refused_by_more_states(folder: Path, catalog: Catalog) -> None:
    """A refusal inside a state that answers it is no override; a new state refuses, or copies an answer."""
    overrides = """\
codes: {waits: {label: it waits at the dock}}
states: {RETURNING: {states: {DOCKED: {on: {mission.start: {refuse: waits}}}}}}
"""
    chart = charted(folder, overrides, catalog)
    assert [rule.refuse for rule in taken(chart, "RETURNING.DOCKED", "mission.start")] == ["waits"]


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        (
            "profile: warehouse",
            "profile: the profile of greenhouse-robot, SHIPPED, cannot be overridden: its states belong to "
            "that profile; remove it",
        ),
        (
            "inputs: {missing: {initial: [x]}}",
            "inputs.missing: the input 'missing' of greenhouse-robot, SHIPPED, cannot be overridden: the "
            "answer to a start in 'READY' reads it; remove it",
        ),
        (
            "states: {READY: {on: {mission.*: MISSION}}}",
            "states.READY.on.mission.*: this answers a start, which greenhouse-robot does in "
            "SHIPPED: every project answers a start in the same way; remove it, or refuse the start here",
        ),
        (
            "states: {DONE: {on: {mission.start: MISSION}}}",
            "states.DONE.on.mission.start: the transition under 'mission.start' of greenhouse-robot, "
            "SHIPPED, cannot be overridden: every project answers a start in the same way; remove it",
        ),
        (
            "on: {nav.arrived: {releases: estop}}",
            "on: this releases the hold 'estop' of greenhouse-robot, SHIPPED: every project is held and "
            "released in the same way; remove it",
        ),
        (
            "states: {MISSION: {on: {operator.resume: {refuse: not_running}}}}",
            "states.MISSION.on.operator.resume: this answers 'operator.resume', which releases the hold "
            "'pause' of greenhouse-robot, SHIPPED: every project is held and released in the same way; "
            "remove it",
        ),
        (
            "states: {DONE: {on: {operator.*: {target: READY, during: [pause, estop]}}}}",
            "states.DONE.on.operator.*: this answers 'operator.resume', which releases the hold 'pause' of "
            "greenhouse-robot, SHIPPED: every project is held and released in the same way; remove it",
        ),
        (
            "states: {RETURNING: {states: {DOCKED: {on: {operator.resume: MISSION.history}}}}}",
            "states.RETURNING.states.DOCKED.on.operator.resume: this answers 'operator.resume', which "
            "releases the hold 'pause' of greenhouse-robot, SHIPPED: every project is held and released in "
            "the same way; remove it",
        ),
        (
            "on: {operator.pause: DONE}",
            "on.operator.pause: this answers 'operator.pause', which engages the hold 'pause' of "
            "greenhouse-robot, SHIPPED: every project is held and released in the same way; remove it",
        ),
        (
            "holds: {no: {engage: operator.resume, engage_guard: 'false', release: operator.dock, code: x}}",
            "holds.no.engage: this asks for 'operator.resume', which releases the hold 'pause' of "
            "greenhouse-robot, SHIPPED: every project is held and released in the same way; name another "
            "request",
        ),
        (
            "states: {RETURNING: {states: {DRIVING_HOME: {invoke: {on_hold: continue}}}}}",
            "states.RETURNING.states.DRIVING_HOME.invoke.on_hold: this changes what a hold does to the "
            "operation of greenhouse-robot, SHIPPED: every project is held and released in the same way; "
            "remove it",
        ),
        (
            "states: {RETURNING: {states: {LOOK: {on: {mission.start: MISSION}}}}}",
            "states.RETURNING.states.LOOK.on.mission.start: this answers a start, which greenhouse-robot "
            "does in SHIPPED: every project answers a start in the same way; remove it, or refuse the "
            "start here",
        ),
        (
            "states: {CLEANING: {on: {mission.*: [{refuse: not_ready, guard: 1 > 2}, MISSION]}}}",
            "states.CLEANING.on.mission.*: this answers a start, which only the states of greenhouse-robot "
            "do: every project answers a start in the same way; remove it, refuse the start here, or copy "
            "the answers of an inherited state: 'use: STATE'",
        ),
        (
            "states: {RETURNING: {states: {LOOK: {on: {mission.start: {use: READY}}}}}}",
            "states.RETURNING.states.LOOK.on.mission.start: this answers a start, which greenhouse-robot "
            "does in SHIPPED: every project answers a start in the same way; remove it, or refuse the "
            "start here",
        ),
        (
            "on: {mission.*: MISSION}",
            "on.mission.*: this answers a start, which only the states of greenhouse-robot do: every "
            "project answers a start in the same way; remove it, or refuse the start here",
        ),
        (
            "initial: DONE",
            "initial: the initial state of greenhouse-robot, SHIPPED, cannot be overridden: every robot "
            "begins by waiting for what it needs; remove it",
        ),
        (
            "params: {battery_low_threshold: {default: 0 %}}",
            "params.battery_low_threshold: the parameter 'battery_low_threshold' of greenhouse-robot, "
            "SHIPPED, cannot be overridden: the input 'battery' reads it; remove it; a robot's own value "
            "is given to it as a parameter",
        ),
        (
            "codes: {estop_engaged: {severity: info, label: nothing}}",
            "codes.estop_engaged.severity: the hold 'estop' of greenhouse-robot, SHIPPED, reports this "
            "code: every project is held and released in the same way; remove it; 'label' and 'advice' may "
            "differ",
        ),
        (
            "params: {dock_timeout_s: {type: length, default: 2 m}}",
            "params.dock_timeout_s.type: the type of 'dock_timeout_s' of greenhouse-robot, SHIPPED, cannot "
            "be overridden: what reads it expects that type; remove it",
        ),
    ],
)
def test_what_stops_and_what_starts_stays(overrides: str, text: str, folder: Path, catalog: Catalog) -> None:
    """In the shipped lifecycle: each refusal names the place in both files, and why."""
    assert text in told(folder, f"{overrides}\n", catalog)


def test_a_property_may_be_watched_more_strictly(folder: Path, catalog: Catalog) -> None:
    """And others may be added; none is taken away."""
    overrides = """\
properties:
  ends_at_home: {breach: fault}
  boots_once: {never: in_state('BOOT') and was_in_state('DONE')}
"""
    chart = charted(folder, overrides, catalog)
    assert chart.properties["ends_at_home"].breach == "fault"
    assert chart.properties["ends_at_home"].never is not None
    assert "boots_once" in chart.properties
    weaker = "properties: {ends_at_home: {never: in_state('DONE') and was_in_state('MISSION')}}\n"
    (text,) = told(folder, weaker, catalog)
    assert text.startswith("properties.ends_at_home: the property 'ends_at_home' of greenhouse-robot, ")


def test_it_can_be_written_as_one_file(folder: Path, catalog: Catalog) -> None:
    """Read again, that has the same states, transitions and declarations."""
    lifecycle, missions = written(folder, "states:\n  RETURNING:\n    on: {operator.skip_current: DONE}\n")
    extending = load_chart(lifecycle, missions, catalog)
    lifecycle.write_text(yaml_text(expanded(lifecycle)))
    whole = load_chart(lifecycle, missions, catalog)
    assert "extends" not in lifecycle.read_text()
    assert rules_of(whole) == rules_of(extending)
    assert whole.extends == ""
    lifecycle.write_text(HEAD + "holds: {pause: {code: battery_low}}\n")
    with pytest.raises(ChartError, match="cannot be overridden"):
        expanded(lifecycle)


def test_a_carried_one_counts_before_the_installed(
    folder: Path, catalog: Catalog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bundle carries both: it is the same where none is installed, or another."""
    from lupin_engine.missions.bundle import make_bundle

    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    loaded = load_files(*written(folder, "params: {dock_retry_max: {default: 4}}\n"), catalog)
    names = loaded.short_names
    assert [*names.values()] == ["lifecycle.yaml", "extends/greenhouse-robot.yaml", "wait.yaml"]
    files = {names[name]: raw for name, raw in loaded.sources.items()}
    bundle = folder / "wait.lupin"
    bundle.write_bytes(make_bundle("wait.yaml", loaded.hash, files, None))

    def nowhere() -> Path:
        raise UsageError("this installation ships no missions; name a mission file")

    monkeypatch.setattr(folders, "default_missions_folder", nowhere)
    assert shipped_lifecycles() == {}
    mission = unpack(read_bundle(bundle))
    again = load_files(mission.parent / "lifecycle.yaml", [mission], catalog)
    assert again.hash == loaded.hash
    assert again.chart.parameters["dock_retry_max"].default == 4


@pytest.mark.parametrize("value", ["", "[]", "{}", "3", "true", "x", "[[]]", "[{a: {}}]", "{a: {b: c}}"])
@pytest.mark.parametrize(
    "form",
    [
        "{}",
        "holds: {}",
        "inputs: {}",
        "params: {{dock_timeout_s: {}}}",
        "properties: {{ends_at_home: {}}}",
        "states: {}",
        "states: {{READY: {}}}",
        "states: {{READY: {{on: {}}}}}",
        "states: {{READY: {{on: {{mission.*: {}}}}}}}",
        "states: {{RETURNING: {{on: {{operator.resume: {{target: DONE, releases: {}}}}}}}}}",
        "states: {{RETURNING: {{states: {{DRIVING_HOME: {{invoke: {}}}}}}}}}",
        "states: {{RETURNING: {{states: {{DRIVING_HOME: {{always: {}}}}}}}}}",
    ],
)
def test_nothing_odd_is_a_traceback(form: str, value: str, folder: Path, catalog: Catalog) -> None:
    """Whatever stands where something is overridden is a finding; what is empty and new adds nothing."""
    adds_nothing = value == "[]" and ("mission.*" in form or "releases" in form)
    assert told(folder, form.format(value) + "\n", catalog) or (form, value) == ("{}", "") or adds_nothing


def test_nothing_can_be_taken_out(folder: Path, catalog: Catalog) -> None:
    """By nothing, nor by an empty list: a transition, actions, a state."""
    for overrides, path in (
        ("RETURNING: {on: {operator.dock: []}}", "RETURNING.on.operator.dock"),
        ("READY: {always: []}", "READY.always"),
        ("DONE: {entry: []}", "DONE.entry"),
        ("DONE: {entry: }", "DONE.entry"),
        ("DONE: ", "DONE"),
    ):
        assert told(folder, f"states: {{{overrides}}}\n", catalog) == [
            f"states.{path}: nothing is written here, and nothing of greenhouse-robot can be taken out; "
            "write the keys that differ, or remove this one"
        ]
