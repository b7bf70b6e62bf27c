"""What comes out of loading: a chart with resolved names, typed values and what it needs from outside."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.load import (
    LIFECYCLE,
    check_chart,
    default_missions_folder,
    find_mission,
    load_chart,
    mission_files,
)
from lupin_engine.chart.model import Chart, Constant, Expression, Kind
from lupin_engine.errors import ChartError, Severity, UsageError
from lupin_engine.plugin.registry import Catalog

CHARTS = Path(__file__).parents[1] / "charts"
GOOD = CHARTS / "good"
MISSIONS = Path(__file__).parents[2] / "missions"


def good(name: str, catalog: Catalog) -> Chart:
    """Load a good mission in the mini lifecycle."""
    return load_chart(CHARTS / "mini" / LIFECYCLE, [GOOD / f"{name}.yaml"], catalog)


@pytest.fixture(scope="module")
def shipped(catalog: Catalog) -> Chart:
    """The shipped inspection mission."""
    return load_chart(MISSIONS / LIFECYCLE, [MISSIONS / "inspection.yaml"], catalog)


def damaged(text: str, chance: random.Random) -> str:
    """Break a file as an editor's user would: lines lost, doubled, moved; letters mistyped."""
    lines = text.split("\n")
    for _ in range(chance.choice([1, 1, 2, 4])):
        at, other = chance.randrange(len(lines)), chance.randrange(len(lines))
        line = lines[at]
        column = chance.randrange(len(line) + 1)
        changes = [
            line[:column] + chance.choice("{}[]:'\"#&*!%@, x$-") + line[column + 1 :],
            line[:column],
            "  " + line,
            line[2:],
            lines[other],
        ]
        lines[at] = chance.choice(changes)
    return "\n".join(lines)


@pytest.mark.parametrize("seed", range(40))
def test_no_damage_to_a_file_becomes_a_traceback(seed: int, tmp_path: Path, catalog: Catalog) -> None:
    """Whatever is in the files: a chart, or findings that say where."""
    chance = random.Random(seed)
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    path = chance.choice(sorted(tmp_path.rglob("*.yaml")))
    path.write_text(damaged(path.read_text(), chance))
    chart, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "inspection.yaml"], catalog)
    assert chart is not None or any(d.severity is Severity.ERROR for d in found)


@pytest.mark.parametrize("mission", sorted(GOOD.glob("*.yaml")), ids=lambda path: path.stem)
def test_nothing_is_said_against_a_good_chart(mission: Path, catalog: Catalog) -> None:
    """No error and no warning."""
    chart, found = check_chart(CHARTS / "mini" / LIFECYCLE, [mission], catalog)
    assert found == ()
    assert chart is not None


def test_states_are_named_by_their_path(shipped: Chart) -> None:
    """In document order, parents before children, parts expanded."""
    inspecting = "MISSION.InspectionMission.INSPECTING"
    assert list(shipped.states)[:6] == [
        "",
        "BOOT",
        "READY",
        "MISSION",
        "MISSION.InspectionMission",
        "MISSION.InspectionMission.PREPARE",
    ]
    assert shipped.states[f"{inspecting}.SCANNING.READING"].parent == f"{inspecting}.SCANNING"
    assert shipped.states[inspecting].initial == f"{inspecting}.NAVIGATING"
    assert shipped.states[inspecting].place.file.endswith("inspection.yaml")
    assert shipped.states[f"{inspecting}.NAVIGATING"].place.file.endswith("visit_targets.yaml")


@pytest.mark.parametrize(
    ("state", "label", "mission"),
    [
        ("", "", ""),
        ("BOOT", "BOOT", ""),
        ("RETURNING.DOCKED", "RETURNING", ""),
        ("MISSION", "", ""),
        ("MISSION.history", "", ""),
        ("MISSION.InspectionMission", "", "InspectionMission"),
        ("MISSION.InspectionMission.PREPARE.LOCALIZING", "PREPARE", "InspectionMission"),
        ("MISSION.InspectionMission.INSPECTING.SCANNING.READING", "INSPECTING", "InspectionMission"),
    ],
)
def test_a_state_is_published_under_its_label(state: str, label: str, mission: str, shipped: Chart) -> None:
    """What the operator's screen shows: the lifecycle's states, and in the slot the mission's."""
    assert (shipped.states[state].label, shipped.states[state].mission) == (label, mission)


def test_the_slot_holds_a_wrapper_for_each_mission(shipped: Chart) -> None:
    """Its history remembers the wrapper and one level below: the family that a divert left."""
    slot, history = shipped.states["MISSION"], shipped.states["MISSION.history"]
    assert slot.slot
    assert slot.initial == "MISSION.InspectionMission"
    assert slot.children == ("MISSION.InspectionMission", "MISSION.history")
    assert (history.kind, history.depth, history.initial) == (Kind.HISTORY, 2, None)
    assert shipped.missions["InspectionMission"].state == "MISSION.InspectionMission"


def test_with_several_missions_the_slot_has_no_initial(catalog: Catalog) -> None:
    """The request says which."""
    paths = [GOOD / "tours.yaml", GOOD / "knocks.yaml"]
    chart = load_chart(CHARTS / "mini" / LIFECYCLE, paths, catalog)
    assert chart.states["MISSION"].initial is None
    assert chart.states["MISSION"].children == ("MISSION.Tours", "MISSION.Knocks")
    assert list(chart.missions) == ["Tours", "Knocks"]


def test_targets_are_found_in_the_nearest_scope(shipped: Chart) -> None:
    """A mission's error leads to the lifecycle's FAULT, and DOCKED comes back by history."""
    localizing = shipped.states["MISSION.InspectionMission.PREPARE.LOCALIZING"].transitions
    assert [t.target for t in localizing] == ["MISSION.InspectionMission.INSPECTING", "FAULT"]
    docked = shipped.states["RETURNING.DOCKED"].transitions
    assert [t.target for t in docked] == [None, None, "MISSION.history", "DONE"]


def test_transitions_are_named_by_where_they_stand(shipped: Chart) -> None:
    """The name is the same in every run, so logs can be compared."""
    ids = [t.id for t in shipped.states["MISSION.InspectionMission.INSPECTING.PUBLISHING"].transitions]
    assert ids == [
        "MISSION.InspectionMission.INSPECTING.PUBLISHING.always.0",
        "MISSION.InspectionMission.INSPECTING.PUBLISHING.always.1",
    ]
    everything = [t.id for state in shipped.states.values() for t in state.transitions + state.resume_at]
    assert len(everything) == len(set(everything))


def test_answers_are_copied_from_another_state(shipped: Chart) -> None:
    """`{use: READY}`: the same answers, taken from here."""
    ready, done = shipped.states["READY"].transitions, shipped.states["DONE"].transitions
    assert [(t.target, t.refuse, t.place) for t in done] == [(t.target, t.refuse, t.place) for t in ready]
    assert [t.id for t in done] == ["DONE.on.mission.start.0", "DONE.on.mission.start.1"]
    assert {t.source for t in done} == {"DONE"}


def test_a_chart_says_what_it_needs(shipped: Chart) -> None:
    """Which plugins to wait for, which parameters to declare, which codes can be reported."""
    assert shipped.plugins == ("arm", "bridge", "nav", "perception")
    assert {"dock_pose", "tag_sequence", "nav_timeout_s", "battery_hysteresis"} <= set(shipped.parameters)
    assert shipped.parameters["nav_timeout_s"].default == 60.0
    assert shipped.parameters["battery_low_threshold"].maximum == 1.0
    assert {"dock_unreachable", "scan_timeout", "nav_status_6", "unknown_tag"} <= set(shipped.codes)
    assert [Path(file).name for file in shipped.files] == [
        "lifecycle.yaml",
        "inspection.yaml",
        "visit_targets.yaml",
    ]


def test_arguments_and_limits_are_typed_values(shipped: Chart) -> None:
    """Constants in base units, expressions compiled."""
    invoke = shipped.states["MISSION.InspectionMission.INSPECTING.NAVIGATING"].invoke
    assert invoke is not None
    assert isinstance(invoke.arguments["pose"], Expression)
    assert invoke.timeout is not None
    assert invoke.timeout.evaluate({"param": {"nav_timeout_s": 60.0}}) == 60.0
    assert invoke.timeout_code == "nav_timeout"
    assert invoke.retry is not None
    assert invoke.retry.unless == {"amcl_drift_var"}
    assert isinstance(invoke.retry.backoff, Constant)
    assert invoke.retry.backoff.value == 1.0


def test_holds_have_their_guards(shipped: Chart) -> None:
    """`in_state` is resolved to full names at load."""
    pause, estop = shipped.holds["pause"], shipped.holds["estop"]
    assert pause.engage_guard is not None
    asked: list[tuple[str, ...]] = []
    pause.engage_guard.evaluate({"in_state": asked.append})
    assert asked == [("MISSION",), ("RETURNING",)]
    assert estop.release == ("operator.resume", "mission.start")
    assert estop.release_guard is not None
    assert estop.release_guard.evaluate({"input": {"estop": True}}) is False


def test_an_action_knows_whether_it_moves_the_robot(shipped: Chart) -> None:
    """A hold keeps back those that do."""
    (preset,) = shipped.states["MISSION.InspectionMission.INSPECTING.NAVIGATING"].entry
    assert (preset.name, preset.moves) == ("arm.preset", True)


def test_a_part_is_composed_once_for_every_use(catalog: Catalog) -> None:
    """Values handed on by a use replace the parameter there, and only there."""
    chart = good("knocks", catalog)
    first, second = (chart.states[f"MISSION.Knocks.{name}.RESTING"].timers[0] for name in ("FIRST", "SECOND"))
    env = {"request": {"pause": 3.0}, "param": {"knock_pause_s": 1.0}}
    assert (first.after.evaluate(env), second.after.evaluate(env)) == (6.0, 1.0)
    invoke = chart.states["MISSION.Knocks.FIRST.KNOCKING"].invoke
    assert invoke is not None
    assert invoke.arguments["pose"].evaluate({}) == {"x": 1.0, "y": 2.0, "yaw": 0.0}
    assert "knock_pause_s" in chart.parameters


def test_a_parameter_that_every_use_gives_is_none_of_the_chart(tmp_path: Path, catalog: Catalog) -> None:
    """Nobody could set it from outside."""
    for path in (CHARTS / "mini" / LIFECYCLE, GOOD / "parts" / "knock.yaml"):
        target = tmp_path / path.relative_to(path.parents[1 if path.name == "knock.yaml" else 0])
        target.parent.mkdir(exist_ok=True)
        target.write_text(path.read_text())
    text = (GOOD / "knocks.yaml").read_text().replace("use: knock\n    on_done: done", "after: {1 s: done}")
    (tmp_path / "knocks.yaml").write_text(text)
    chart = load_chart(tmp_path / LIFECYCLE, [tmp_path / "knocks.yaml"], catalog)
    assert "knock_pause_s" not in chart.parameters


def test_every_kind_of_state_is_there(catalog: Catalog) -> None:
    """Parallel states enter all children, histories know their depth, timers their event."""
    states = good("kinds", catalog).states
    both = states["MISSION.Kinds.BOTH"]
    assert (both.kind, both.initial) == (Kind.PARALLEL, None)
    assert states["MISSION.Kinds.BOTH.history"].depth is None
    back = states["MISSION.Kinds.BOTH.LEFT.back"]
    assert (back.kind, back.depth, back.initial) == (Kind.HISTORY, None, "MISSION.Kinds.BOTH.LEFT.A")
    waiting = states["MISSION.Kinds.BOTH.LEFT.A"]
    assert [timer.event for timer in waiting.timers] == ["after.0", "after.1"]
    assert [(t.id.rpartition("A.")[2], t.event) for t in waiting.transitions] == [
        ("after.0", "after.0"),
        ("after.1", "after.1"),
        ("after.1.1", "after.1"),
    ]
    assert states["MISSION.Kinds.WAITING"].paused
    assert [t.event for t in states["MISSION.Kinds"].transitions] == ["operator.dock"]


def test_all_errors_of_all_files_travel_together(tmp_path: Path, catalog: Catalog) -> None:
    """One run tells everything, in file order."""
    (tmp_path / LIFECYCLE).write_text("lifecycle: L\nsumary: x\nstates: {A: {slot: mission, on_done: B}}\n")
    (tmp_path / "m.yaml").write_text("mission: M\nstates: {A: {after: {5: done}}, done: {type: final}}\n")
    with pytest.raises(ChartError) as caught:
        load_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    found = caught.value.diagnostics
    assert [(Path(d.place.file).name, d.rule) for d in found] == [
        ("lifecycle.yaml", "unknown-key"),
        ("lifecycle.yaml", "unknown-state"),
        ("m.yaml", "no-unit"),
    ]


def test_a_mission_is_found_by_file_by_name_and_by_path() -> None:
    """As people call it."""
    inspection = MISSIONS / "inspection.yaml"
    assert find_mission("inspection", [MISSIONS]) == inspection
    assert find_mission("InspectionMission", [GOOD, MISSIONS]) == inspection
    assert find_mission(str(inspection), []) == inspection
    assert default_missions_folder() == MISSIONS
    assert inspection in mission_files(MISSIONS)
    assert MISSIONS / LIFECYCLE not in mission_files(MISSIONS)


@pytest.mark.parametrize(
    ("name", "text"),
    [("inspektion", "did you mean 'inspection'"), ("none.yaml", "no mission file"), ("x", "allowed: ")],
)
def test_an_unknown_mission_is_answered_with_those_there_are(name: str, text: str) -> None:
    """The nearest spelling, or the list."""
    with pytest.raises(UsageError, match=text):
        find_mission(name, [MISSIONS])
