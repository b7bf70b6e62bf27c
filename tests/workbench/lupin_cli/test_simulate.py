"""`lupin simulate` at the terminal: columns, figures, pictures, real time, chance, and the session."""

from __future__ import annotations

import io
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from lupin_cli.main import main
from lupin_cli.requests import check_complete
from lupin_cli.terminal import outcome as verb
from lupin_cli.terminal.debugger import Debugger
from lupin_cli.verbs.run import run
from lupin_cli.verbs.simulate import simulate
from lupin_engine.errors import UsageError
from lupin_engine.missions.selection import load_missions
from lupin_engine.replay.story import columns_for, laid_out
from lupin_engine.sim.narration import StepLine, narrate
from lupin_engine.sim.simulation import Run, Script
from lupin_engine.sim.simulation import simulate as run_script
from tests import shipped

MISSIONS = Path(__file__).parents[3] / "missions"
SCENARIOS = Path(__file__).parents[2] / "scenarios" / "inspection"


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every test the same terminal."""
    monkeypatch.setenv("COLUMNS", "122")
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)


def typed(*arguments: str, typing: str | None = None) -> Result:
    """Return what the verb prints; its return value is its exit code."""
    result = CliRunner().invoke(simulate, arguments, input=typing, standalone_mode=False)
    assert result.exception is None, result.exception
    return result


# -- the story --------------------------------------------------------------------------------------------

WIDE = (Path(__file__).parent / "data" / "story.txt").read_text(encoding="utf-8")


def test_the_story_has_columns() -> None:
    """Time, state, event, commands; what is too long goes on below, and is cut in the end."""
    assert typed("inspection", "--tags", "1").output.startswith(WIDE)


NARROW = """\
     0.0 s  BOOT                  start
                                  start plugins.ready
     0.0 s  READY                 plugins.ready done
     0.0 s  PREPARE.LOCALIZING    mission.start accepted
                                  start
                                  nav.localize(max_variance: ...
     0.5 s  INSPECTING.           nav.localize done
            NAVIGATING.FOLDING    do arm.preset(name: home)
            -> INSPECTING.        start nav.go_to(pose: {x 1.1,
            NAVIGATING.DRIVING    y 1.3, yaw 0}, ...
     3.5 s  INSPECTING.SCANNING.  nav.go_to done
            READING               do arm.preset(name: inspect)
                                  start bridge.read_tag(tag_id:
                                  1)
     3.7 s  INSPECTING.SCANNING.  bridge.read_tag done
            DWELLING              publish 1 OK
     4.7 s  INSPECTING.           time is up in
            PUBLISHING ->         INSPECTING.SCANNING.DWELLING
            RETURNING.            start nav.dock(pose: {x 0, y
            DRIVING_HOME          0, yaw 0})
     7.7 s  DONE                  nav.dock done
                                  report 1 visits

"""


def test_a_narrow_terminal_has_commands_below_their_event(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is wider than the terminal."""
    monkeypatch.setenv("COLUMNS", "64")
    output = typed("inspection", "--tags", "1", "--set", "flower_scan_dwell_s=1 s").output
    assert output.startswith(NARROW)


@pytest.mark.parametrize("width", [40, 60, 80, 110, 160, 240])
def test_a_story_is_as_wide_as_the_terminal(width: int) -> None:
    """Whatever happens in it: retries, holds, refusals."""
    from lupin_engine.plugin.registry import load_catalog
    from lupin_engine.sim.scenario import load_scenario

    catalog = load_catalog()
    for name in (
        "inspection/drive_times_out",
        "inspection/estop_and_pause",
        "inspection/start_refused_for_unknown_tag",
        "exploration/seeded_once",
    ):
        run = load_scenario(SCENARIOS.parent / f"{name}.scenario.yaml", catalog).run()
        lines = narrate(run.chart, run.history)
        columns = columns_for(lines, width)
        rows = ["".join(text for text, _ in row) for line in lines for row in laid_out(line, columns)]
        assert max(map(len, rows)) <= width
        assert all(row == row.rstrip() for row in rows)
        assert all(rows)


def test_regions_entered_together_are_told_as_such() -> None:
    """An arrow would say that the second one was entered from the first."""
    scenario = SCENARIOS.parent / "exploration" / "seeded_once.scenario.yaml"
    lines = typed(str(scenario)).output.splitlines()
    begins = next(i for i, line in enumerate(lines) if line.startswith("     0.5 s"))
    assert [line[12:38].strip() for line in lines[begins : begins + 2]] == [
        "EXPLORING.SEARCH.CHOOSING",
        "+ EXPLORING.SEED_CLIMATE",
    ]


def test_refusals_and_notes_stand_out() -> None:
    """Each piece of a line knows what it is about; the terminal colours it."""
    line = StepLine(
        1.0,
        "operator.pause REFUSED: no",
        "",
        (("publish 2 SKIPPED", "left out"), ("cancel nav.go_to", "")),
        ("why",),
        True,
    )
    tones = [tone for row in laid_out(line, columns_for([line], 120)) for text, tone in row if text.strip()]
    assert tones == ["time", "refused", "left out", "command", "note"]


# -- the figures ------------------------------------------------------------------------------------------


def test_the_figures_say_where_the_time_went() -> None:
    """Before the last line; how long it took to compute is the only thing that differs from run to run."""
    lines = typed(str(SCENARIOS / "drive_times_out.scenario.yaml"), "-q").output.splitlines()
    computed, last = lines[-2:]
    assert computed.startswith("computed    in 0.")
    assert lines[-5:-2] == [
        "states      PREPARE 0.5 s, INSPECTING 47.4 s, RETURNING 3.0 s",
        "phases      LOCALIZING 0.5 s, NAVIGATING 47.0 s, SCANNING 0.4 s",
        "operations  plugins.ready 1, nav.localize 1, nav.go_to 4 (2 timed out, 1 retry), bridge.read_tag 2, "
        "nav.dock 1",
    ]
    assert last == (
        "DONE: 2 visited, 1 unreachable of 3 targets in 50.9 s of virtual time; "
        "last: nav_timeout (recovery behaviour)"
    )


def test_json_has_all_of_it() -> None:
    """And is the same every time."""
    arguments = (str(SCENARIOS / "estop_and_pause.scenario.yaml"), "--json")
    output = typed(*arguments).output
    found = json.loads(output)
    assert typed(*arguments).output == output
    assert {name for held in found["held"] for name in held["held"]} == {"pause", "estop"}
    assert set(found) >= {"summary", "view", "visits", "published", "steps", "timeline", "context", "seed"}
    assert [lane["name"] for lane in found["timeline"]["holds"]] == ["pause", "estop"]
    assert sum(found["summary"]["states"].values()) == pytest.approx(found["seconds"])


# -- until, seed, speed -----------------------------------------------------------------------------------


def test_until_a_state() -> None:
    """It is over when that is entered, which is what was wanted."""
    result = typed("inspection", "--tags", "1,2", "--until", "SCANNING")
    assert result.return_value == 0
    assert "INSPECTING.SCANNING.READING" in result.output.splitlines()[-8]
    assert result.output.splitlines()[-1] == (
        "INSPECTING: nothing visited of 2 targets in 3.5 s of virtual time; stopped where --until says"
    )


def test_until_a_state_that_is_not_entered() -> None:
    """Then it ends as it does."""
    assert typed("inspection", "--tags", "1", "--until", "CONFIRMING", "-q").return_value == 0
    assert typed("inspection", "--tags", "99", "--until", "SCANNING", "-q").return_value == 2


def test_scenarios_can_be_stopped_too() -> None:
    """By a state or a time, whatever their own limit is."""
    file = str(SCENARIOS / "three_tags.scenario.yaml")
    assert (
        "in 2.0 s of virtual time; stopped where --until says" in typed(file, "--until", "2 s", "-q").output
    )
    assert "stopped where --until says" in typed(file, "--until", "NAVIGATING", "-q").output


def test_a_seed_decides_what_comes_by_chance(tmp_path: Path) -> None:
    """The same seed, the same run; it counts over the scenario's own."""
    scenario = tmp_path / "a.scenario.yaml"
    scenario.write_text(
        "scenario: drives take their time\nmission: inspection\nrequest: {tag_sequence: ['1', '2']}\n"
        "mocks:\n  - do: nav.go_to\n    then: {after: {between: [1 s, 9 s]}}\nexpect: {final: DONE}\n"
    )

    def seconds(*more: str) -> float:
        found = json.loads(typed(str(scenario), "--json", *more).output)["seconds"]
        assert isinstance(found, float)
        return found

    assert seconds("--seed", "3") == seconds("--seed", "3")
    assert len({seconds("--seed", str(seed)) for seed in range(5)}) == 5
    assert seconds() == seconds("--seed", "0")


def one_tag() -> Run:
    """Simulate one tag."""
    script = Script("InspectionMission", {"tag_sequence": ["1"]})
    return run_script(shipped.mission("inspection"), script)


def test_a_story_can_take_its_time() -> None:
    """Between two lines the time goes by that is between them."""
    waited: list[float] = []
    console = verb.make_console()
    console.file = io.StringIO()
    run = one_tag()
    verb.print_story(run, console, waited.append)
    assert waited == pytest.approx([0.5, 3.0, 0.2, 3.0])
    assert sum(waited) == pytest.approx(run.seconds)


def test_speed_is_a_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times as fast takes a tenth of the time; none, no time at all."""
    slept: list[float] = []
    monkeypatch.setattr("time.sleep", slept.append)
    typed("inspection", "--tags", "1", "--speed", "10")
    assert sum(slept) == pytest.approx(0.67)
    slept.clear()
    typed("inspection", "--tags", "1")
    assert slept == []


def test_ctrl_c_ends_a_story(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a word about Python."""

    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("time.sleep", interrupt)
    result = typed("inspection", "--tags", "1", "--speed", "1")
    assert result.return_value == 130
    assert result.output == "".join(line + "\n" for line in WIDE.splitlines()[:3]) + "\n"


FAILING = """\
mission: Failing
context:
  count: {type: number, default: 0}
states:
  GOING:
    invoke:
      do: nav.go_to
      with: {pose: "${ approach(tags.named(['1'])[round(1 / count)]) }"}
      timeout: {after: 60 s, code: nav_timeout}
    on_done: done
    on_error: LOOKING
  LOOKING:
    invoke:
      do: nav.go_to
      with: {pose: "${ approach(tags.named(['999'])[0]) }"}
      timeout: {after: 60 s, code: nav_timeout}
    on_done: done
    on_error: done
  done: {type: final}
initial: GOING
"""
FAILED = (
    "failing.yaml:7:7: float division by zero",
    "failing.yaml:14:7: unknown tag '999'; the layout has 29 tags: 1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13,",
)


def test_expressions_that_fail_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it happens, in the figures, in the last line and in the exit code, although the mission ends."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "failing.yaml").write_text(FAILING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = typed("failing.yaml")
    assert result.return_value == 2
    story, figures = result.output.split("\n\n")
    for text in FAILED:
        assert " ".join(story.split()).count(f"error execution_error: {text}") == 1
        assert figures.count(f"error       {text}") == 1
    assert figures.splitlines()[-1] == ("DONE in 3.0 s of virtual time; 2 expressions or actions failed")
    told = json.loads(typed("failing.yaml", "--json").output)
    assert (told["exit_code"], list(told["summary"]["errors"].values())) == (2, [1, 1])
    assert typed("failing.yaml", "-q", "--until", "LOOKING").return_value == 2


SWEEPING = """\
mission: Sweeping
codes:
  time_is_up: {label: time is up, severity: info}
states:
  WALKING:
    budget: {after: 1 min, code: time_is_up, target: done}
    itinerary: {items: "${ tags.named(['1', '2', '3', '4', '5']) }", sweeps: 0}
    use: visit_targets
    with: {stand: "${ approach(target) }", max_variance: 1e6}
    on_done: done
  done: {type: final}
initial: WALKING
"""


def test_sweeps_that_the_time_ends_count_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All five were visited, although not all of them in the last sweep."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "sweeping.yaml").write_text(SWEEPING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = typed("sweeping.yaml")
    assert "DONE: 5 visited of 5 targets in 63.0 s of virtual time\n" in result.output
    assert "info time_is_up" in result.output
    assert result.return_value == 0


# -- pictures ---------------------------------------------------------------------------------------------


def test_a_timeline_goes_into_a_file(tmp_path: Path) -> None:
    """By the file's name; the same run gives the same file."""
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    for file in (first, second):
        typed("inspection", "--tags", "1,2", "-q", "--timeline", str(file))
    assert first.read_text(encoding="utf-8").startswith("<svg ")
    assert first.read_bytes() == second.read_bytes()


def test_a_timeline_goes_to_the_terminal() -> None:
    """As wide as that."""
    lines = typed("inspection", "--tags", "1,2", "-q", "--timeline", "-").output.splitlines()
    assert lines[0] == "                ▼start"
    assert lines[1].startswith("        PREPARE ")
    assert max(map(len, lines[:14])) == 122


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--timeline", "a.gif"], "'a.gif' ends in neither .svg nor .png; - draws in the terminal"),
        (["--timeline", "file/a.svg"], "no picture can be written to 'file': File exists"),
        (["--timeline", "folder.svg"], "cannot write 'folder.svg': Is a directory"),
        (["--until", "SCANING"], "--until: no state 'SCANING'; did you mean 'SCANNING'?"),
        (["--until", "5 parsecs"], "write a duration such as '90 s' or '20 min'"),
        (
            ["--interactive", "--json"],
            "--interactive goes with --tags, --goal, --request, --set, --clock and --seed only",
        ),
        (["--clock", "22:00"], "--clock: expected a date with a time of day, got '22:00'"),
        (["--seed", "x"], "'x' is not a valid integer"),
        (["--speed", "-1"], "not in the range"),
    ],
)
def test_wrong_options_are_told(
    arguments: list[str],
    told: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """Exit code 2, and what is allowed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "folder.svg").mkdir()
    assert main(["simulate", "inspection", "--tags", "1", *arguments]) == 2
    assert told in capsys.readouterr().err


def test_all_wrong_options_are_told_at_once(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of a mission, and of a scenario, which has a request and parameters of its own."""
    monkeypatch.chdir(tmp_path)
    wrong = ["--until", "SCANING", "--timeline", "a.gif", "--set", "nav_timeout=5", "--goal", "3"]
    both = [
        "lupin: --timeline: 'a.gif' ends in neither .svg nor .png; - draws in the terminal",
        "--until: no state 'SCANING'; did you mean 'SCANNING'?",
    ]
    of_missions = [
        "InspectionMission has no use for --goal: its request has no discovery_goal; it has tag_sequence",
        "--set: unknown parameter 'nav_timeout'; did you mean 'nav_timeout_s'?",
    ]
    assert main(["simulate", "inspection", *wrong, "--set", "tag_locations_file=absent.json"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        both[0],
        *of_missions,
        both[1],
        "tag_locations_file 'absent.json' cannot be used: No such file or directory",
    ]
    assert main(["simulate", str(SCENARIOS / "three_tags.scenario.yaml"), "-i", *wrong]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "lupin: --interactive goes with --tags, --goal, --request, --set, --clock and --seed only",
        both[0].removeprefix("lupin: "),
        "a scenario names its own request and parameters; "
        "--tags, --goal, --request and --set are for missions",
        both[1],
    ]


def test_a_broken_mission_is_not_done(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Exit code 2 as for a run, because 1 says that targets were missed; the finding has its place."""
    file = tmp_path / "broken.yaml"
    file.write_text(
        "mission: Broken\ninitial: A\nstates:\n  A: {after: {1 s: B}, phaze: X}\n  B: {type: final}\n"
    )
    told = f"{file}:4:24: error: states.A: unknown key 'phaze'; did you mean 'phase'? [unknown-key]\n"
    assert main(["simulate", str(file), "--timeline", "a.gif"]) == 2
    assert capsys.readouterr().err == told


# -- by hand ----------------------------------------------------------------------------------------------

BY_HAND = """\
0.0 s READY> strat
unknown command 'strat'; did you mean 'start'?
0.0 s READY> start tag_sequence=7
     0.0 s  PREPARE.LOCALIZING            mission.start accepted
                                          start nav.localize(max_variance: 0.25)
0.0 s PREPARE LOCALIZING> run 250 ms
0.2 s PREPARE LOCALIZING> send pause
     0.2 s                                operator.pause accepted
                                          info paused_by_operator
                                          (hold pause engaged)
0.2 s PREPARE LOCALIZING [pause]> quit
"""


def test_a_session_through_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is typed is shown, so that the output reads as it was."""
    commands = [line.partition("> ")[2] for line in BY_HAND.splitlines() if "> " in line]
    monkeypatch.setenv("COLUMNS", "100")
    result = typed("inspection", "-i", typing="\n".join([*commands, ""]))
    assert result.return_value == 0
    assert result.output.partition("quit ends\n")[2] == BY_HAND


def test_the_end_of_the_input_ends_a_session() -> None:
    """Ctrl-D; nothing else but quit does."""
    result = typed("inspection", "-i", typing="start tag_sequence=1\nrun\n")
    assert result.return_value == 0
    assert result.output.splitlines()[-2:] == ["the mission is over: DONE", "6.7 s DONE> "]


def test_ctrl_c_does_not_end_a_session(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the prompt it begins a new line, in a run it stops that."""

    real, calls = Debugger.do, iter([True, False])

    def do(self: Debugger, line: str) -> Any:
        if next(calls, False):
            raise KeyboardInterrupt
        return real(self, line)

    monkeypatch.setattr(Debugger, "do", do)
    result = typed("inspection", "-i", typing="run\nwhere\nquit\n")
    assert result.output.splitlines()[-5:] == [
        "0.0 s READY> run",
        "interrupted",
        "0.0 s READY> where",
        "  state           READY",
        "0.0 s READY> quit",
    ]


def test_a_scenario_begins_by_itself_in_a_session() -> None:
    """Its mission is started and its happenings come, as it says."""
    file = str(SCENARIOS / "pause_while_navigating.scenario.yaml")
    output = typed(file, "-i", typing="run\nquit\n").output
    assert "operator.pause accepted" in output


def test_a_session_needs_no_other_options() -> None:
    """What makes no sense in it is refused."""
    with pytest.raises(UsageError, match="--interactive goes with"):
        CliRunner().invoke(
            simulate, ["inspection", "-i", "-q"], standalone_mode=False, catch_exceptions=False
        )


ASKING = """\
mission: Asking
states:
  ASKING:
    ask: {question: Go on?, choices: {go_on: Go on, stay: Stay}, default: stay, after: 1 min}
    on:
      answer.go_on: WORKING
      answer.stay: done
  WORKING:
    after: {1 s: done}
  done: {type: final}
initial: ASKING
"""


def test_a_question_is_answered_by_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is seen with what can be answered; an answer is sent like any request."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "asking.yaml").write_text(ASKING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    lines = typed(
        "asking.yaml", "-i", typing="start\nwhere\nsend answer.go_on\nsend answer.stay\nquit\n"
    ).output
    seen = " ".join(lines.split())
    assert "asked Go on? go_on Go on stay Stay" in seen
    assert "WORKING answer.go_on accepted" in seen
    assert "answer.stay REFUSED: the answer 'stay' is refused: nothing is asked" in seen


SURVEY = """\
mission: Survey
states:
  WORKING:
    after: {2 s: {target: done, guard: len(request.tag_sequence) <= request.discovery_goal}}
  done: {type: final}
request:
  tag_sequence: {type: list of tag, summary: where to go}
  discovery_goal: {type: count}
initial: WORKING
"""


def test_a_request_that_must_be_given_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every field at once, with what it holds and what to write; by hand the mission may be started later."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "survey.yaml").write_text(SURVEY, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for command in (simulate, run):
        with pytest.raises(UsageError) as found:
            command.main(["survey.yaml"], standalone_mode=False)
        assert (found.value.exit_code, str(found.value)) == (
            2,
            "Survey needs tag_sequence (list of tag: where to go); write --tags 1,5,12\n"
            "Survey needs discovery_goal (count); write --goal COUNT",
        )
    assert typed("survey.yaml", "--tags", "1", "--goal", "1", "-q").return_value == 0
    by_hand = " ".join(typed("survey.yaml", "-i", typing="start\n").output.split())
    assert (
        "REFUSED: Survey needs tag_sequence (list of tag: where to go), discovery_goal (count) 0.0 s"
        in by_hand
    )


RESTING = """\
mission: Resting
states:
  RESTING:
    after: {"${ request.rest }": done}
  done: {type: final}
request:
  rest: {type: duration, default: 1 min}
  rounds: {type: count, default: 1, min: 1}
  tag_sequence: {type: list of tag, default: []}
initial: RESTING
"""


@pytest.fixture
def resting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A mission whose request has fields that the profile has no option for."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "resting.yaml").write_text(RESTING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return "resting.yaml"


def test_any_field_of_the_request_is_given(resting: str) -> None:
    """With its unit, as in a file; a plugin's type is read by its plugin; by hand it is the mission's too."""
    given = ("--request", "rest=2 min", "--request", "tag_sequence=1,5")
    assert "RESTING 120.0 s" in typed(resting, *given, "-q").output
    by_hand = typed(resting, "-i", *given, typing="start\nrun\nquit\n").output
    assert "   120.0 s  RETURNING.DRIVING_HOME " in by_hand


def test_all_that_is_wrong_with_a_request_is_told_at_once(resting: str) -> None:
    """In the same words by both verbs: what has no type, no unit, no field, and what is given twice."""
    fields = ("rest=90", "rounds=many", "ronds=1", "height", "tag_sequence=1")
    given = [word for field in fields for word in ("--request", field)]
    for command in (simulate, run):
        with pytest.raises(UsageError) as found:
            command.main([resting, "--tags", "5", "--goal", "1", *given], standalone_mode=False)
        assert str(found.value).splitlines() == [
            "Resting has no use for --goal: its request has no discovery_goal; "
            "it has rest, rounds, tag_sequence",
            "'height' has no '='; write --request NAME=VALUE",
            "--request: rest: 90 has no unit; write '90 s'",
            "--request: rounds: expected count, got 'many'",
            "--request: unknown field 'ronds'; did you mean 'rounds'?",
            "tag_sequence: given by an option of its own and by --request; leave one out",
        ]


def test_what_is_given_counts_also_where_it_is_nothing(resting: str) -> None:
    """An option's 0 leaves the field to the mission; a run is refused before anything starts."""
    with pytest.raises(UsageError, match=r"^rounds must be at least 1, got 0$"):
        run.main([resting, "--request", "rounds=0"], standalone_mode=False)
    assert "rounds must be at least 1, got 0" in typed(resting, "--request", "rounds=0").output


def test_a_scenario_has_a_request_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    """As for the other options."""
    file = str(SCENARIOS / "three_tags.scenario.yaml")
    assert main(["simulate", file, "--request", "tag_sequence=1"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "lupin: a scenario names its own request and parameters; "
        "--tags, --goal, --request and --set are for missions"
    ]


def test_a_field_without_an_option_is_asked_for_by_request(tmp_path: Path) -> None:
    """A profile may have fields without an option."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "survey.yaml").write_text(SURVEY, encoding="utf-8")
    catalog = shipped.catalog()
    profile = catalog.profiles["greenhouse"]
    bare = {name: replace(field, option="") for name, field in profile.request.items()}
    profiles = {**catalog.profiles, "greenhouse": replace(profile, request=bare)}
    loaded = load_missions([str(tmp_path / "survey.yaml")], replace(catalog, profiles=profiles))
    with pytest.raises(UsageError) as found:
        check_complete(loaded, {"discovery_goal": 1})
    assert str(found.value) == (
        "Survey needs tag_sequence (list of tag: where to go); write --request tag_sequence=..."
    )
