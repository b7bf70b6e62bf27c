"""Missions as parts of others, over the shipped inspection and lifecycle: every target is told once."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_cli.terminal.panels import variables
from lupin_engine.chart.model import Chart
from lupin_engine.diagram.descriptions import ElementTexts
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.reload import successor
from lupin_engine.machine.snapshot import restore
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.replay import coverage
from lupin_engine.replay.reconstruction import read_recording, scenario_text
from lupin_engine.runtime.record import step_record
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scenario import Missions, load_scenario_text
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import (
    Ask,
    Happening,
    Restart,
    Run,
    Script,
    SetValue,
    Simulation,
    simulate,
)
from tests import shipped

Load = Callable[..., Chart]

EVENING = """\
mission: Evening
request:
  tag_sequence: {type: list of tag, default: "${ tags.named(['1', '5', '12']) }"}
initial: PATROL
states:
  PATROL:
    use: inspection
    with: {tag_sequence: "${ request.tag_sequence }"}
    on_done: AGAIN
  AGAIN:
    use: inspection
    with: {tag_sequence: "${ tags.named(['16', '20']) }"}
    on_done: done
  done: {type: final}
"""
EVERY = ["1", "12", "16", "20", "5"]
#: From the start to the end: localizing, driving and reading in the first and in the second inspection.
MOMENTS = [0.2, 0.6, 3.6, 4.0, 8.0, 10.05, 10.3, 12.0, 13.6, 16.4]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Load missions beside the shipped ones, of which only those that are named can be started."""

    def loaded(text: str = EVENING, *others: str, **files: str) -> Chart:
        shutil.copytree(default_missions_folder(), tmp_path, dirs_exist_ok=True)
        for name, content in {"evening": text, **files}.items():
            folder = tmp_path / "parts" if content.startswith("part:") else tmp_path
            (folder / f"{name}.yaml").write_text(content, encoding="utf-8")
        names = [tmp_path / f"{name}.yaml" for name in ("evening", *others)]
        return load_chart(tmp_path / LIFECYCLE, names, shipped.catalog())

    return loaded


def evening(chart: Chart, *happenings: Happening, **more: object) -> Run:
    """Simulate an evening."""
    return simulate(chart, Script("Evening", happenings=happenings, **more))  # type: ignore[arg-type]


def asked(request: str, at: float) -> Happening:
    """Ask for something at a time."""
    return Happening(Ask(f"operator.{request}"), at)


def told(run: Run) -> list[str]:
    """Return the targets that were told of, each as often as it was."""
    return sorted(published.target for _, published in run.history.published)


def test_two_itineraries_follow_one_another(load: Load) -> None:
    """Each walks its own list, and what is published of the mission is about both."""
    run = evening(load())
    assert (run.ended, told(run), run.view.lifecycle) == (True, EVERY, "DONE")
    assert (run.view.total, run.view.counts["OK"]) == (5, 5)
    assert [visit.target for visit in run.visits] == ["1", "5", "12", "16", "20"]
    (report,) = run.history.reports
    assert [visit["status"] for visit in report.visits] == ["OK"] * 5
    assert run.history.lifecycles == ["BOOT", "READY", "PATROL", "AGAIN", "RETURNING", "DONE"]


def test_what_is_to_come_is_counted_from_the_start(load: Load) -> None:
    """Both lists follow from the request, so nobody has to wait for the second one."""
    run = evening(load(), limit=5.0)
    assert (run.view.total, run.view.counts["OK"], run.view.target) == (5, 1, "5")


@pytest.mark.parametrize("at", MOMENTS)
def test_an_abort_tells_every_target_once(load: Load, at: float) -> None:
    """In the first itinerary, in the second, and before the robot knows where it is."""
    run = evening(load(), asked("abort", at))
    assert (run.view.lifecycle, told(run)) == ("DONE", EVERY)
    assert (run.view.total, sum(run.view.counts.values())) == (5, 5)
    assert run.view.counts["SKIPPED"] > 0


@pytest.mark.parametrize("nth", [1, 2])
def test_a_fault_tells_every_target_once(load: Load, nth: int) -> None:
    """FAULT closes what is open in all itineraries, in the first or the second inspection."""
    fine = [MockOutcome()] * (nth - 1)
    lost = Rule("nav.localize", (*fine, MockOutcome(never=True)), once=True)
    run = evening(load(), rules=(lost,))
    assert (run.view.lifecycle, told(run)) == ("FAULT", EVERY)
    assert {v.code for v in run.visits if v.status == "SKIPPED"} == {"mission_failed"}


@pytest.mark.parametrize("at", MOMENTS)
def test_a_divert_returns_into_the_mission_that_is_used(load: Load, at: float) -> None:
    """The visit that it interrupted goes on, and nothing that was told is told again."""
    run = evening(load(), asked("dock", at), asked("resume", 100.0))
    assert (run.ended, told(run)) == (run.ended, EVERY)
    if run.ended:
        assert (run.view.lifecycle, run.view.counts["OK"]) == ("DONE", 5)


@pytest.mark.slow
@pytest.mark.parametrize("at", MOMENTS)
def test_a_restart_goes_on_where_it_was(load: Load, at: float) -> None:
    """Also while it waits at the dock: what the mission was given is in the journal."""
    plain = evening(load(), Happening(Restart(3.0), at), asked("resume", at + 5.0))
    assert (plain.ended, told(plain), plain.view.counts["OK"]) == (True, EVERY, 5)
    docked = evening(load(), asked("dock", at), Happening(Restart(), 60.0), asked("resume", 100.0))
    assert told(docked) == EVERY


def test_it_can_be_started_by_itself_as_well(load: Load) -> None:
    """The same file is a mission and a part, and neither knows of the other."""
    chart = load(EVENING, "inspection")
    assert list(chart.missions) == ["Evening", "InspectionMission"]
    alone = simulate(chart, Script("InspectionMission", {"tag_sequence": ["1"]}))
    assert ([v.target for v in alone.visits], alone.view.total) == (["1"], 1)
    assert told(evening(chart)) == EVERY


WRONG = """\
mission: Evening
context:
  row: {type: length, default: 100 m}
initial: PATROL
states:
  PATROL:
    use: inspection
    with: {tag_sequence: "${ [tag for tag in tags.numeric_order() if tag.x > row] }"}
    on_done: done
  done: {type: final}
"""


STRAIGHT = """\
mission: Straight
codes: {none_there: {label: nothing to visit}}
request:
  tag_sequence: {type: list of tag, default: "${ tags.numeric_order() }", not_empty: none_there}
states:
  VISITING:
    itinerary: {items: "${ request.tag_sequence }"}
    use: visit_targets
    with: {stand: "${ approach(target) }", max_variance: 1}
    on_done: done
  done: {type: final}
"""


def test_what_follows_from_a_wrong_value_is_not_told_as_well(load: Load, tmp_path: Path) -> None:
    """The itinerary that would have walked it has nothing to walk."""
    run = evening(load(WRONG.replace("inspection", "straight"), straight=STRAIGHT))
    assert run.history.errors == [f"{tmp_path}/evening.yaml:8:26: use Straight: nothing to visit"]


def test_a_wrong_value_at_run_time_is_an_error_with_its_place(load: Load, tmp_path: Path) -> None:
    """The mission that is used would have refused such a request; nothing of it begins."""
    run = evening(load(WRONG))
    problem = f"{tmp_path}/evening.yaml:8:26: use InspectionMission: no tags to visit"
    assert (run.view.lifecycle, run.history.errors) == ("FAULT", [problem])
    assert "nav.localize" not in {attempt.operation for attempt in run.history.attempts.values()}


COUNTING = """\
mission: Counting
context:
  seen: {type: count, default: 0}
  begun: {type: count, default: 0}
request:
  most: {type: count, default: 3, min: 2}
  names: {type: list of text, default: ["a"], distinct: true}
entry:
  - set: {begun: "${ begun + 1 }"}
exit:
  - report.note: {text: "left after ${ seen }"}
on:
  operator.skip_current: {internal: true, do: {set: {seen: "${ request.most }"}}}
states:
  LOOKING:
    after: {10 s: {target: LOOKED, do: {set: {seen: "${ seen + 1 }"}}}}
  LOOKED:
    always:
      - {target: done, guard: seen >= request.most}
      - target: LOOKING
  done: {type: final, result: {seen: "${ seen }", begun: "${ begun }", names: "${ len(request.names) }"}}
initial: LOOKING
"""
TWICE = """\
mission: Evening
context:
  total: {type: count, default: 0}
  least: {type: count, default: 2}
states:
  FIRST:
    use: counting
    on_done:
      target: SECOND
      do:
        - set: {total: "${ total + event.seen + 100 * event.begun + 1000 * event.names }"}
  SECOND:
    use: counting
    with: {most: "${ least }", names: ["b", "c", "b"]}
    on_done:
      target: done
      do:
        - set: {total: "${ total + event.seen + 100 * event.begun + 1000 * event.names }"}
  done: {type: final}
initial: FIRST
"""


def test_context_and_entry_begin_with_each_use(load: Load) -> None:
    """The request is what the use says, by the mission's own defaults where it says nothing."""
    run = evening(load(TWICE, counting=COUNTING))
    assert (run.ended, run.context["total"], run.seconds) == (True, 3 + 2 + 200 + 1000 + 2000, 50.0 + 3.0)
    assert [note for step in run.steps for note in step.notes if note.startswith("left")] == [
        "left after 3",
        "left after 2",
    ]


COUNT = """\
part: count
context: {n: {type: count, default: 0}}
initial: A
states:
  A: {after: {1 s: {target: done, do: [set: {n: "${ n + 1 }"}]}}}
  done: {type: final}
"""
IN_TURN = "initial: A\nstates:\n  A: {use: count, on_done: B}\n  B: {%suse: count, on_done: done}\n"
AT_ONCE = (
    "initial: A\nstates:\n  A: {type: parallel, states: {B: {use: count}, C: {use: count}}, on_done: done}\n"
)


@pytest.mark.parametrize(
    ("states", "counted"),
    [(IN_TURN % "", 2), (IN_TURN % "entry: [set: {n: 0}], ", 1), (AT_ONCE, 2)],
    ids=["in turn", "begun anew", "at once"],
)
def test_two_uses_of_a_part_have_the_same_variables(load: Load, states: str, counted: int) -> None:
    """Those of a mission that is used begin with each use; of a part only where its user says so."""
    run = evening(load(f"mission: Evening\n{states}  done: {{type: final}}\n", count=COUNT))
    assert (run.ended, run.context["n"]) == (True, counted)


def test_a_return_from_the_dock_is_no_beginning(load: Load) -> None:
    """What was counted stays, and `entry` has run; `exit` runs whenever the mission is left."""
    run = evening(load(TWICE, counting=COUNTING), asked("dock", 15.0), asked("resume", 50.0))
    assert (run.ended, run.context["total"]) == (True, 3 + 2 + 200 + 1000 + 2000)
    assert sum(note.startswith("left") for step in run.steps for note in step.notes) == 3


def test_what_the_file_says_for_all_states_counts_in_a_part(load: Load) -> None:
    """A mission's own `on` is offered within the state that uses it, with the request of the use."""
    run = evening(load(TWICE, counting=COUNTING), asked("skip_current", 5.0))
    assert (run.ended, run.seconds) == (True, 10.0 + 20.0 + 3.0)


@pytest.mark.parametrize(
    ("least", "problem"),
    [("1", "most must be at least 2, got 1"), ("0", "most must be at least 2, got 0")],
)
def test_a_minimum_holds_at_run_time(load: Load, tmp_path: Path, least: str, problem: str) -> None:
    """As it does for who starts the mission."""
    run = evening(load(TWICE.replace("default: 2", f"default: {least}"), counting=COUNTING))
    assert run.history.errors == [f"{tmp_path}/evening.yaml:14:18: use Counting: {problem}"]


NESTED = """\
mission: Evening
states:
  ROUND:
    initial: REST
    states:
      REST: {after: {5 s: PATROL}}
      PATROL: {use: night, on_done: over}
      over: {type: final}
    on_done: done
  done: {type: final}
"""
NIGHT = """\
mission: Night
states:
  DEEP: {use: counting, with: {most: 4}, on_done: done}
  done: {type: final}
"""


def test_a_divert_returns_however_deep_the_mission_stands(load: Load) -> None:
    """The lifecycle remembers the state of the outer mission only; of one that is used it remembers more."""
    chart = load(NESTED, night=NIGHT, counting=COUNTING)
    run = evening(chart, asked("dock", 30.0), asked("resume", 50.0))
    back = next(step for step in run.steps if step.event.name == "operator.resume")
    assert back.entered[-1] == "MISSION.Evening.ROUND.PATROL.DEEP.LOOKING"
    assert (run.ended, run.context["seen"], run.context["begun"]) == (True, 4, 1)


REQUEST = """\
request:
  tag_sequence: {type: list of tag, default: "${ tags.named(['1', '5']) }"}
"""
GIVEN = """\
    with: {tag_sequence: "${ request.tag_sequence }"}
"""
WALKED = f"""\
mission: Evening
{REQUEST}context:
  rounds: {{type: count, default: 0}}
states:
  PATROL:
    use: inspection
{GIVEN}    entry:
      - set: {{rounds: "${{ rounds + 1 }}"}}
    on_done:
      - {{target: RESTING, guard: rounds < 3}}
      - target: done
  RESTING: {{after: {{10 s: PATROL}}}}
  done: {{type: final}}
initial: PATROL
"""


def test_an_itinerary_that_is_begun_anew_is_counted_anew(load: Load) -> None:
    """Three rounds of two targets are six visits of six; what is shown of a target is its newest visit."""
    run = evening(load(WALKED))
    assert (run.view.total, run.view.counts["OK"], told(run)) == (6, 6, ["1"] * 3 + ["5"] * 3)
    assert [visit.target for visit in run.visits] == ["1", "5"]


OVERLAPPING = EVENING.replace("['16', '20']", "['5', '16']")


def test_a_target_of_two_itineraries_is_told_once_where_none_is_begun(load: Load) -> None:
    """Where both are walked it is told in both: it was visited twice."""
    early = evening(load(OVERLAPPING), asked("abort", 0.2))
    assert told(early) == ["1", "12", "16", "5"]
    whole = evening(load(OVERLAPPING))
    assert (told(whole), whole.view.total) == (["1", "12", "16", "5", "5"], 5)


def test_a_target_that_is_named_twice_is_two_visits(load: Load) -> None:
    """From the start: a list that may hold it twice is walked as it is."""
    twice = EVENING.replace("['1', '5', '12']", "['1', '1']")
    assert told(evening(load(twice), asked("abort", 0.2))) == ["1", "1", "16", "20"]
    assert told(evening(load(twice))) == ["1", "1", "16", "20"]


def test_what_is_told_of_the_world_is_shared(load: Load) -> None:
    """A level of the lifecycle leads the whole mission home, and back into the part."""
    battery = (
        Happening(SetValue("robot.battery", 0.1), 4.0),
        Happening(SetValue("robot.battery", 1.0), 60.0),
    )
    run = evening(load(), *battery, asked("resume", 100.0))
    assert (run.ended, told(run), run.view.counts["OK"]) == (True, EVERY, 5)


TIMED = """\
mission: Timed
codes: {too_long: {label: too long}}
states:
  LOOKING:
    budget: {after: 25 s, code: too_long, target: late}
    states:
      WAITING: {after: {20 s: enough}}
      enough: {type: final}
    on_done: done
  late: {type: final, result: {late: true}}
  done: {type: final, result: {late: false}}
"""


def test_a_budget_is_that_of_one_use(load: Load) -> None:
    """The second time the states have all their time again; it is no mission's time in all."""
    text = WALKED.replace("use: inspection", "use: timed").replace(GIVEN, "").replace(REQUEST, "")
    run = evening(load(text, timed=TIMED))
    assert (run.ended, run.view.code, run.context["rounds"]) == (True, "", 3)


HOME = """\
mission: Home
states:
  WAITING:
    on:
      operator.skip_current: RETURNING
    after: {10 s: done}
  done: {type: final}
"""
AROUND = """\
mission: Evening
states:
  FIRST: {use: home, on_done: RETURNING}
  RETURNING: {after: {1 s: done}}
  done: {type: final}
initial: FIRST
"""


def test_a_mission_that_is_used_names_no_state_around_it(load: Load) -> None:
    """Its `RETURNING` is that of the lifecycle, as where it stands by itself; its user's is its own."""
    chart = load(AROUND, home=HOME)
    states = chart.states
    ways = {rule.event: rule.target for rule in states["MISSION.Evening.FIRST.WAITING"].transitions}
    assert ways["operator.skip_current"] == "RETURNING"
    (done,) = states["MISSION.Evening.FIRST"].transitions
    assert done.target == "MISSION.Evening.RETURNING"
    run = evening(chart, asked("skip_current", 5.0))
    assert run.history.lifecycles == ["BOOT", "READY", "FIRST", "RETURNING", "DONE"]
    assert "MISSION.Evening.RETURNING" not in {name for step in run.steps for name in step.entered}


PART = """\
part: counted
params:
  most: {type: count}
states:
  COUNTING: {use: counting, with: {most: "${ param.most }", names: "${ request.names }"}, on_done: over}
  over: {type: final}
"""
THROUGH = """\
mission: Evening
request:
  names: {type: list of text, default: ["x", "y"]}
states:
  FIRST: {use: counted, with: {most: "${ len(request.names) + 2 }"}, on_done: done}
  done: {type: final}
"""


def test_a_part_uses_a_mission_with_the_request_of_the_mission_around(load: Load) -> None:
    """What the part reads is of who uses it; what the mission reads is what the part gave it."""
    run = evening(load(THROUGH, counted=PART, counting=COUNTING))
    assert (run.ended, run.context["seen"], run.seconds) == (True, 4, 40.0 + 3.0)


def test_a_run_can_be_made_a_scenario(load: Load, tmp_path: Path) -> None:
    """The record of the steps says all that is needed."""
    run = evening(load(), asked("dock", 8.0), asked("resume", 100.0))
    (tmp_path / "missions").mkdir()
    steps = json.loads(json.dumps([step_record(step) for step in run.steps]))
    place = tmp_path / "made.scenario.yaml"
    missions = Missions(shipped.catalog())
    text = scenario_text(read_recording(json.dumps({"steps": steps}), "run.json"), "it", place, missions)
    made = load_scenario_text(text, place, missions)
    again = made.run()
    assert (made.failures(again), told(again)) == ([], EVERY)


def test_missions_are_loaded_anew_between_two_runs(load: Load) -> None:
    """What the mission of before was given is forgotten with its states; what was told stays in view."""
    before, after = load(), load(EVENING.replace("PATROL", "ROUND").replace("AGAIN", "MORE"))
    memory = restore(before, evening_of(before).snapshot())
    machine = successor(Machine(make_world(before, {}), memory), make_world(after, {}))
    assert (machine.view.lifecycle, machine.memory.given) == ("DONE", {})


def evening_of(chart: Chart) -> Machine:
    """Return the machine at the end of an evening."""
    running = Simulation(chart, Script("Evening"), {})
    running.run()
    return running.machine


def test_what_it_is_given_is_shown_and_drawn(load: Load) -> None:
    """In the simulation by hand, as long as it runs; in a picture, as it is written."""
    chart = load(TWICE, counting=COUNTING)
    running = Simulation(chart, Script("Evening"), {})
    running.begin()
    while "MISSION.Evening.SECOND" not in running.machine.memory.configuration:
        running.advance()
    lines = ["".join(text for text, _ in line) for line in variables(running)]
    given = [" ".join(line.split()) for line in lines if "." in line]
    assert given == ["SECOND.most 2", "SECOND.names [b, c]"]
    states, words = chart.states, ElementTexts(chart)
    drawn = [str(next(words.lines(states[f"MISSION.Evening.{name}"]))) for name in ("FIRST", "SECOND")]
    assert drawn == ["mission Counting", "mission Counting: most least, names [b, c]"]


def test_coverage_counts_every_use(load: Load) -> None:
    """Under the mission that was started, as for parts."""
    chart = load(TWICE, counting=COUNTING)
    items = [item for item in coverage.items(chart) if item.text.startswith("SECOND.")]
    assert {item.mission for item in items} == {"Evening"}
    assert {"SECOND.LOOKING", "SECOND.LOOKED", "SECOND.done"} <= {item.text for item in items}


RAISING = """\
mission: Raising
request:
  most: {type: count, default: 3}
entry:
  - raise: {event: row.begun, with: {most: "${ request.most }"}}
on:
  row.begun: {internal: true, do: [report.note: {text: "begun with ${ event.most }"}]}
states:
  WAITING: {after: {1 s: done}}
  done: {type: final}
"""


def test_what_its_file_raises_for_all_states_is_known(load: Load) -> None:
    """Also where the mission cannot be started by itself, so that its file stands nowhere else."""
    text = WALKED.replace("use: inspection", "use: raising").replace(GIVEN, "").replace(REQUEST, "")
    run = evening(load(text, raising=RAISING))
    assert sum(note == "begun with 3" for step in run.steps for note in step.notes) == 3


def happenings(chance: random.Random) -> list[Happening]:
    """Let some of what can happen happen in the first minute; then somebody brings it to an end."""
    kinds: list[Ask | SetValue | Restart] = [
        *(Ask(f"operator.{name}") for name in ("abort", "dock", "pause", "resume", "resume", "skip_current")),
        *(SetValue("robot.estop", stopped) for stopped in (True, False)),
        *(SetValue("robot.battery", charge) for charge in (0.1, 1.0)),
        Restart(1.0),
    ]
    found = [Happening(chance.choice(kinds), chance.uniform(0.0, 60.0)) for _ in range(chance.randint(1, 6))]
    for at in (200.0, 220.0, 300.0, 320.0):
        mended = (SetValue("robot.estop", False), SetValue("robot.battery", 1.0), Ask("operator.resume"))
        found += [Happening(what, at + number) for number, what in enumerate(mended)]
    return found


def test_whatever_happens_every_target_is_told_once(load: Load) -> None:
    """Of both itineraries: drawn from seeds, so that what fails can be looked at."""
    chart = load()
    for seed in range(60):
        run = evening(chart, *happenings(random.Random(seed)))
        assert (told(run), run.history.errors) == (EVERY, []), seed
        if run.view.lifecycle != "READY":  # it was restarted when all was over
            counted = (run.view.total, sum(run.view.counts.values()))
            assert (run.view.lifecycle, counted) == ("DONE", (5, 5)), seed
