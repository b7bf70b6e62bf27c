"""What comes out of loading: a chart with resolved names, typed values and what it needs from outside."""

from __future__ import annotations

import os
import random
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

import lupin_engine
from lupin_engine.chart import findings
from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.model import Chart, Kind
from lupin_engine.errors import ChartError, Severity, UsageError
from lupin_engine.missions.folders import (
    LIFECYCLE,
    default_missions_folder,
    find_mission,
    is_missions_folder,
    lifecycle_in,
    lifecycle_of,
    mission_files,
)
from lupin_engine.missions.load import MAX_CHARTS, check_chart, forget, load_chart, load_files
from lupin_engine.plugin.registry import Catalog, load_catalog

CHARTS = Path(__file__).parents[2] / "charts"
GOOD = CHARTS / "good"
MISSIONS = Path(__file__).parents[3] / "missions"
TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"


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


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_no_damage_to_a_file_becomes_a_traceback(seed: int, tmp_path: Path, catalog: Catalog) -> None:
    """Whatever is in the files: a chart, or findings that say where."""
    chance = random.Random(seed)
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    path = chance.choice(sorted(tmp_path.rglob("*.yaml")))
    path.write_text(damaged(path.read_text(), chance))
    chart, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "inspection.yaml"], catalog)
    assert chart is not None or any(d.severity is Severity.ERROR for d in found)


def copied(tmp_path: Path, name: str = "knocks") -> tuple[Path, list[Path]]:
    """Copy a good mission with the lifecycle and the parts that it needs; return lifecycle and missions."""
    shutil.copytree(GOOD / "parts", tmp_path / "parts")
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path / LIFECYCLE)
    shutil.copy(GOOD / f"{name}.yaml", tmp_path / "m.yaml")
    return tmp_path / LIFECYCLE, [tmp_path / "m.yaml"]


def test_what_has_not_changed_is_not_read_twice(tmp_path: Path, catalog: Catalog) -> None:
    """The same chart, and the same words about it; for another catalog, it is another chart."""
    files = copied(tmp_path)
    (tmp_path / "m.yaml").write_text((tmp_path / "m.yaml").read_text() + "codes: {unused: {label: unused}}\n")
    chart, found = check_chart(*files, catalog)
    assert chart is not None
    assert {d.severity for d in found} == {Severity.WARN}
    again, told_again = check_chart(*files, catalog)
    assert again is chart
    assert told_again == found
    assert check_chart(*files, replace(catalog))[0] is not chart
    forget()
    assert check_chart(*files, catalog)[0] is not chart


def test_an_edit_is_seen_whatever_the_clock_says(tmp_path: Path, catalog: Catalog) -> None:
    """The content counts, not the time of the file; taken back, the chart is the one before."""
    lifecycle, missions = copied(tmp_path)
    part = tmp_path / "parts" / "knock.yaml"
    before, stamp = part.read_text(), part.stat()
    first = load_chart(lifecycle, missions, catalog)
    part.write_text(before.replace("summary: ", "summary: x", 1))
    os.utime(part, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    second = load_chart(lifecycle, missions, catalog)
    part.write_text(before)
    assert second is not first
    assert load_chart(lifecycle, missions, catalog) is first


def test_places_name_the_file_that_was_read(tmp_path: Path, catalog: Catalog) -> None:
    """The same bytes under another name are another document."""
    lifecycle, (mission,) = copied(tmp_path)
    mission.write_text("mission: M\nstates: {A: {on_done: B}}\n")
    other = mission.with_name("n.yaml")
    shutil.copy(mission, other)
    for path in (mission, other):
        found = check_chart(lifecycle, [path], catalog)[1]
        assert {d.place.file for d in found if d.rule == "unknown-state"} == {str(path)}


def test_only_the_newest_are_remembered(tmp_path: Path, catalog: Catalog) -> None:
    """The cache is small."""
    lifecycle, (mission,) = copied(tmp_path)
    text = mission.read_text()
    first = load_chart(lifecycle, [mission], catalog)
    for number in range(MAX_CHARTS):
        mission.write_text(f"{text}\n# edit {number}\n")
        load_chart(lifecycle, [mission], catalog)
    mission.write_text(text)
    assert load_chart(lifecycle, [mission], catalog) is not first


def test_two_threads_may_read_the_same_file(tmp_path: Path, catalog: Catalog) -> None:
    """They get the same chart, or at least an equal one."""
    files = copied(tmp_path)
    forget()
    with ThreadPoolExecutor(4) as pool:
        charts = list(pool.map(lambda _: load_chart(*files, catalog), range(8)))
    assert len({tuple(chart.states) for chart in charts}) == 1
    assert load_chart(*files, catalog) in charts


@pytest.mark.parametrize("state", ["{on_done: T%d}", "{always: {target: S1, guard: in_state(T%d)}}"])
def test_so_many_mistakes_are_not_all_told(
    state: str, tmp_path: Path, catalog: Catalog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is compared with all names; unbounded, a generated file would keep the checker for minutes."""
    monkeypatch.setattr(findings, "MAX_FINDINGS", 100)
    lifecycle, (mission,) = copied(tmp_path)
    lines = [f"  S{n}: {state % n}" for n in range(110)]
    mission.write_text("\n".join(["mission: M", "states:", *lines]))
    chart, found = check_chart(lifecycle, [mission], catalog)
    assert chart is None
    told = [one for one in found if one.rule != "unused-part"]
    assert len(told) == 100 + 2
    (last,) = (one for one in told if one.rule == "too-large")
    assert (last.path, last.problem, last.hint) == (
        "",
        "more than 100 findings, the rest is not told",
        "mend these first",
    )


def test_a_type_of_too_many_lists_is_told(tmp_path: Path, catalog: Catalog) -> None:
    """It once ended in a RecursionError."""
    lifecycle, (mission,) = copied(tmp_path)
    mission.write_text(
        f"mission: M\ncontext: {{a: {{type: {'list of ' * 2000}text, default: []}}}}\nstates: {{}}\n"
    )
    found = check_chart(lifecycle, [mission], catalog)[1]
    assert ("more than 8 lists in each other", "use fewer") in [(d.problem, d.hint) for d in found]


def test_parts_that_double_what_they_are_given_are_told(tmp_path: Path, catalog: Catalog) -> None:
    """Thirty of them would make an expression of a thousand million operands."""
    lifecycle, (mission,) = copied(tmp_path)
    for n in range(30):
        inner = f'{{use: p{n + 1}, with: {{x: "${{ param.x + param.x }}"}}, on_done: done}}'
        state = inner if n < 29 else '{after: {"${ param.x }": done}}'
        (tmp_path / "parts" / f"p{n}.yaml").write_text(
            f"part: p{n}\nparams: {{x: {{type: duration, default: 1 s}}}}\n"
            f"states: {{A: {state}, done: {{type: final}}}}\n"
        )
    mission.write_text(
        "mission: M\nstates: {A: {use: p0, with: {x: 2 s}, on_done: done}, done: {type: final}}\n"
    )
    chart, found = check_chart(lifecycle, [mission], catalog)
    assert chart is None
    problem = "the expression is too large with the values that stand for its parameters"
    assert {d.problem for d in found if d.rule == "bad-expression"} == {problem}


def test_a_part_must_call_itself_what_its_file_is_called(tmp_path: Path, catalog: Catalog) -> None:
    """Nothing is composed of it."""
    lifecycle, missions = copied(tmp_path)
    part = tmp_path / "parts" / "knock.yaml"
    part.write_text(part.read_text().replace("part: knock", "part: knok"))
    chart, found = check_chart(lifecycle, missions, catalog)
    assert chart is None
    assert [str(d) for d in found] == [
        f"{part}:1:7: error: part: the part calls itself 'knok', its file 'knock'; "
        "write 'part: knock' [bad-name]"
    ]


def test_an_installation_may_ship_no_missions(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Then one must be named."""
    monkeypatch.setattr(lupin_engine, "__file__", str(tmp_path / "site" / "lupin_engine" / "__init__.py"))
    with pytest.raises(UsageError, match=r"^this installation ships no missions; name a mission file$"):
        default_missions_folder()


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
    assert [t.target for t in docked] == [None, None, "MISSION.history"]


def test_transitions_are_named_by_where_they_stand(shipped: Chart) -> None:
    """The name is the same in every run, so logs can be compared."""
    ids = [t.id for t in shipped.states["MISSION.InspectionMission.INSPECTING.PUBLISHING"].transitions]
    assert ids == [
        "MISSION.InspectionMission.INSPECTING.PUBLISHING.on.operator.skip_current.0",
        "MISSION.InspectionMission.INSPECTING.PUBLISHING.always.0",
        "MISSION.InspectionMission.INSPECTING.PUBLISHING.always.1",
    ]
    everything = [t.id for state in shipped.states.values() for t in state.transitions + state.resume_at]
    assert len(everything) == len(set(everything))


def test_answers_are_copied_from_another_state(shipped: Chart) -> None:
    """`{use: READY}`: the same answers, taken from here."""
    ready = [t for t in shipped.states["READY"].transitions if t.event == "mission.start"]
    done = shipped.states["DONE"].transitions
    assert [(t.target, t.refuse, t.place) for t in done] == [(t.target, t.refuse, t.place) for t in ready]
    assert [t.id for t in done] == [f"DONE.on.mission.start.{number}" for number in range(3)]
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
    invoke = shipped.states["MISSION.InspectionMission.INSPECTING.NAVIGATING.DRIVING"].invoke
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
    assert (first.due.evaluate(env), second.due.evaluate(env)) == (6.0, 1.0)
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


def test_an_unknown_mission_is_answered_with_those_there_are(tmp_path: Path) -> None:
    """The nearest spelling, or the list, and where was looked."""
    shutil.copy(GOOD / "tours.yaml", tmp_path)
    shutil.copy(GOOD / "knocks.yaml", tmp_path)
    for name, folders, problem in (
        ("tour", [tmp_path], f"no mission 'tour' in {tmp_path}; did you mean 'tours'?"),
        (
            "x",
            [tmp_path, tmp_path / "none"],
            f"no mission 'x' in {tmp_path}, {tmp_path / 'none'}; "
            "allowed: 'Knocks', 'Tours', 'knocks', 'tours'",
        ),
        ("x", [], "no mission 'x' in no folder; nothing is allowed here"),
        ("none.yaml", [tmp_path], "no mission file 'none.yaml'"),
        ("none.yml", [tmp_path], "no mission file 'none.yml'"),
        ("none/tours", [tmp_path], "no mission file 'none/tours'"),
    ):
        with pytest.raises(UsageError) as caught:
            find_mission(name, folders)
        assert str(caught.value) == problem


def test_what_is_no_mission_is_not_offered_as_one(tmp_path: Path) -> None:
    """Lifecycles and scenarios stand in the same folder; a mission that says no name has its file's."""
    for name, text in (
        ("a.yaml", "mission: A\nstates: {}\n"),
        ("b.yaml", "mission:\n"),
        ("c.yaml", "part: C\nstates: {}\n"),
        ("d.scenario.yaml", "mission: D\n"),
        (LIFECYCLE, "mission: L\n"),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert [path.name for path in mission_files(tmp_path)] == ["a.yaml", "b.yaml"]
    assert find_mission("b", [tmp_path]).name == "b.yaml"


@pytest.mark.parametrize(
    ("folder", "files", "expected"),
    [
        ("missions", ["tours.yaml"], True),
        ("missions", [], False),
        ("missions", ["d.scenario.yaml"], False),
        ("charts", ["tours.yaml"], False),
        ("charts", [LIFECYCLE], True),
    ],
)
def test_where_missions_are_looked_for(folder: str, files: list[str], expected: bool, tmp_path: Path) -> None:
    """A lifecycle says so, or the name of the folder together with a mission in it."""
    (tmp_path / folder).mkdir()
    for name in files:
        (tmp_path / folder / name).write_text("mission: A\nstates: {}\n", encoding="utf-8")
    assert is_missions_folder(tmp_path / folder) is expected


def test_a_mission_runs_in_the_lifecycle_beside_it(tmp_path: Path) -> None:
    """Where there is none, in the shipped one."""
    mission = tmp_path / "m.yaml"
    assert lifecycle_of(mission) == lifecycle_in(tmp_path) == MISSIONS / LIFECYCLE
    (tmp_path / LIFECYCLE).write_text("lifecycle: own\n", encoding="utf-8")
    assert lifecycle_of(mission) == lifecycle_in(tmp_path) == tmp_path / LIFECYCLE


def test_a_part_is_unused_when_all_missions_are_there(tmp_path: Path, catalog: Catalog) -> None:
    """One that is not loaded may use it."""
    lifecycle, (mission,) = copied(tmp_path)
    other = tmp_path / "other.yaml"
    shutil.copy(CHARTS / "mini" / "idle.yaml", other)
    for part in (tmp_path / "parts").glob("*.yaml"):
        if part.stem != "knock":
            part.unlink()
    assert check_chart(lifecycle, [other], catalog)[1] == ()
    assert check_chart(lifecycle, [other, mission], catalog)[1] == ()
    mission.unlink()
    found = check_chart(lifecycle, [other], catalog)[1]
    assert [str(one) for one in found] == [
        f"{tmp_path}/parts/knock.yaml:1:1: warning: no mission uses the part 'knock'; "
        "use it, or remove the file [unused-part]"
    ]


@pytest.mark.parametrize(
    ("name", "hints"), [("WAITNG", ["did you mean 'WAITING'?"]), ("WAITING", []), ("SCANNING", [])]
)
def test_a_lifecycle_may_speak_of_missions_that_are_not_loaded(
    name: str, hints: list[str], tmp_path: Path, catalog: Catalog
) -> None:
    """Of a state that is called like none of those that are loaded nothing is said."""
    text = (CHARTS / "broken" / "unloaded_state.yaml").read_text(encoding="utf-8")
    (tmp_path / LIFECYCLE).write_text(text.replace("WAITNG", name), encoding="utf-8")
    found = check_chart(tmp_path / LIFECYCLE, [CHARTS / "mini" / "idle.yaml"], catalog)[1]
    assert [one.hint for one in found if one.rule == "unknown-state"] == hints


def test_a_part_is_found_wherever_it_is_used(tmp_path: Path, catalog: Catalog) -> None:
    """After a state of which nothing is written, and inside another one."""
    lifecycle, (mission,) = copied(tmp_path)
    mission.write_text(
        "mission: M\ninitial: B\nstates:\n"
        "  A:\n"
        "  B: {on_done: A, states: {C: {use: knok}, over: {type: final}}}\n"
    )
    found = check_chart(lifecycle, [mission], catalog)[1]
    assert [str(one) for one in found if one.rule == "unknown-part"] == [
        f"{mission}:5:37: error: B.C: unknown part or mission 'knok'; did you mean 'knock'? [unknown-part]"
    ]


def test_after_an_unknown_key_ways_are_not_followed(tmp_path: Path, catalog: Catalog) -> None:
    """Half the chart may stand behind it."""
    lifecycle, (mission,) = copied(tmp_path)
    text = "mission: M\ninitial: A\nstates:\n  A: {after: {1 s: done}}\n  B: {after: {1 s: done}}\n"
    text += "  done: {type: final}\n"
    for written, rule in (
        (text, "unreachable-state"),
        (text.replace("A: {", "A: {onn: {}, "), "unknown-key"),
    ):
        mission.write_text(written)
        found = check_chart(lifecycle, [mission], catalog)[1]
        assert [one.rule for one in found if one.rule != "unused-part"] == [rule]


# -- the name of what the files say ---------------------------------------------------------------------


def hash_in(folder: Path, *missions: Path) -> str:
    """Return the hash of the missions of a folder with the plugins that are installed."""
    return load_files(lifecycle_in(folder), missions or mission_files(folder), load_catalog()).hash


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a lifecycle, three missions, a part and a binding."""
    folder = Path(shutil.copytree(MISSIONS, tmp_path / "elsewhere" / "missions"))
    shutil.copy(TUTORIAL / "patrol.yaml", folder)
    shutil.copytree(TUTORIAL / "bindings", folder / "bindings")
    return folder


def test_the_same_files_have_the_same_hash_wherever_they_stand(folder: Path, tmp_path: Path) -> None:
    """Neither the path nor the time makes a difference."""
    other = shutil.copytree(folder, tmp_path / "other")
    for file in other.rglob("*.yaml"):
        os.utime(file, (0, 0))
    assert hash_in(other) == hash_in(folder) != hash_in(MISSIONS)
    forget()
    assert hash_in(Path(os.path.relpath(folder))) == hash_in(other)


@pytest.mark.slow
def test_whatever_file_changes_the_hash_does(folder: Path) -> None:
    """Missions, parts, bindings that are used, and which missions there are."""
    loaded = load_files(folder / LIFECYCLE, mission_files(folder), load_catalog())
    assert list(loaded.short_names.values()) == [
        "lifecycle.yaml",
        "exploration.yaml",
        "inspection.yaml",
        "patrol.yaml",
        "parts/visit_targets.yaml",
        "bindings/photo_arm.yaml",
    ]
    for name in loaded.sources:
        text = Path(name).read_bytes()
        Path(name).write_bytes(text + b"# changed\n")
        assert hash_in(folder) != loaded.hash, name
        Path(name).write_bytes(text)
        assert hash_in(folder) == loaded.hash
    (folder / "inspection.yaml").rename(folder / "inspect.yaml")
    assert hash_in(folder) != loaded.hash
    (folder / "inspect.yaml").unlink()
    assert hash_in(folder) != loaded.hash


def test_what_no_mission_uses_is_not_in_it(folder: Path) -> None:
    """Other files of the folder are not what runs."""
    before = hash_in(folder, folder / "inspection.yaml")
    for file in (folder / "patrol.yaml", folder / "bindings" / "photo_arm.yaml"):
        file.unlink()
    assert hash_in(folder, folder / "inspection.yaml") == before


def test_two_files_of_one_name_are_told_apart(folder: Path, tmp_path: Path) -> None:
    """Missions may be named from several folders."""
    other = tmp_path / "other" / "inspection.yaml"
    shutil.copytree(MISSIONS / "parts", other.parent / "parts")
    text = (MISSIONS / "inspection.yaml").read_text(encoding="utf-8")
    other.write_text(text.replace("mission: InspectionMission", "mission: OtherMission"), encoding="utf-8")
    loaded = load_files(folder / LIFECYCLE, [folder / "inspection.yaml", other], load_catalog())
    assert loaded.short_names[str(other)] == "inspection.2.yaml"
