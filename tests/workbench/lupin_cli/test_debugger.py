"""A simulation that is worked by hand: transcripts, word for word.

A transcript is what stands on the screen: a prompt with what was typed behind it, then the answer. The tests
type the same lines again; ACCEPT=1 writes the transcripts anew.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_cli.settings import read_value
from lupin_cli.terminal.debugger import COMMANDS, Debugger
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.replay.story import TonedLine
from lupin_engine.replay.timeline import Tick, timeline
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import Between, MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Happening, Script
from tests import shipped

TRANSCRIPTS = sorted((Path(__file__).parent / "data" / "debugger").glob("*.transcript.txt"))
_PROMPT = re.compile(r"^\d+\.\d s [A-Z_ ]*(?:\[[a-z, ]*\])?> (.*)$")


def debugger(script: Script | None = None, width: int = 120) -> Debugger:
    """Return a debugger over the inspection mission."""
    chart = shipped.mission("inspection")
    script = script or Script("InspectionMission", starts=False)
    return Debugger(chart, script, make_world(chart, {}), read_value, width)


def plain(rows: list[TonedLine]) -> list[str]:
    """Return lines without their colours."""
    return ["".join(text for text, _ in row) for row in rows]


def answered(one: Debugger, lines: list[str]) -> Iterator[str]:
    """Yield what stands on the screen when these lines are typed."""
    for line in lines:
        yield f"{one.prompt}{line}"
        yield from plain(one.do(line))


@pytest.mark.parametrize("file", TRANSCRIPTS, ids=lambda file: file.name.partition(".")[0])
def test_the_same_lines_give_the_same_transcript(file: Path) -> None:
    """Nothing but what was typed decides."""
    before = file.read_text(encoding="utf-8")
    typed = [match.group(1) for line in before.splitlines() if (match := _PROMPT.match(line))]
    one = debugger()
    found = "\n".join([*plain(one.greeting()), *answered(one, typed), ""])
    if os.environ.get("ACCEPT"):
        file.write_text(found, encoding="utf-8")
    assert found == before
    assert one.over


def test_going_back_takes_the_world_with_it() -> None:
    """Mocks that are used up and dice are as they were: the same is drawn again."""
    rules = (Rule("nav.go_to", (MockOutcome(after=Between(1.0, 9.0)),)),)
    one = debugger(Script("InspectionMission", rules=rules, starts=False, seed=7))
    one.greeting()
    first = list(answered(one, ["start tag_sequence=1,2,5", "run", "back 99"]))
    again = list(answered(one, ["start tag_sequence=1,2,5", "run", "back 99"]))
    assert first == again
    other = debugger(Script("InspectionMission", rules=rules, starts=False, seed=8))
    other.greeting()
    assert list(answered(other, ["start tag_sequence=1,2,5", "run", "back 99"])) != first


def test_a_step_is_taken_back_whole() -> None:
    """Also where things happened in it that are not worth a line."""
    one = debugger()
    list(answered(one, ["start tag_sequence=1", "step", "send pause"]))
    before = one.prompt
    assert plain(one.do("step")) == ["it waits for the operator; why tells what is possible"]
    assert one.prompt != before
    assert plain(one.do("back")) == ["took back step"]
    assert one.prompt == before


def test_what_was_interrupted_is_whole_afterwards() -> None:
    """Ctrl-C may come in the middle of a step: what was done before is done again."""
    one = debugger()
    list(answered(one, ["start tag_sequence=1", "step"]))
    before = plain(one.do("where")), one.prompt
    one.simulation.advance()  # half a step, which no move stands for
    assert plain(one.interrupted()) == ["interrupted"]
    assert (plain(one.do("where")), one.prompt) == before


def test_a_script_goes_on_by_itself() -> None:
    """A scenario's happenings come at their times."""
    script = Script(
        "InspectionMission", {"tag_sequence": ["1"]}, happenings=(Happening(Ask("operator.pause"), 2.0),)
    )
    one = debugger(script)
    assert any("operator.pause accepted" in line for line in plain(one.do("run")))
    assert one.prompt == "3.5 s INSPECTING NAVIGATING [pause]> "


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("", list(COMMANDS)),
        ("st", ["start", "step"]),
        ("start ", ["discovery_goal=", "tag_sequence="]),
        (
            "send op",
            [f"operator.{name}" for name in ("abort", "dock", "pause", "reset", "resume", "skip_current")],
        ),
        ("send mission.start t", ["tag_sequence="]),
        ("set e", ["estop"]),
        ("set estop ", ["false", "true"]),
        ("fail ", ["nav.go_to"]),
        ("fail nav.go_to nav_r", ["nav_rejected"]),
        ("done nav", ["nav.go_to"]),
        ("run SCAN", ["SCANNING", "SCANNING.CONFIRMING", "SCANNING.DWELLING", "SCANNING.READING"]),
        ("why pau", ["pause"]),
        ("help ba", ["back"]),
        ("quit ", []),
        ("strat ", []),
    ],
)
def test_words_are_completed(typed: str, offered: list[str]) -> None:
    """Commands, states, operations, codes, fields, values: whatever can stand there."""
    one = debugger()
    list(answered(one, ["start tag_sequence=1,2", "step"]))
    found = one.complete(typed)
    if typed == "start ":
        assert set(found) <= set(offered)
        assert "tag_sequence=" in found
    else:
        assert found == offered


def test_every_command_is_explained() -> None:
    """By a line in the list and by itself."""
    one = debugger()
    listed = "\n".join(plain(one.do("help")))
    for name, command in COMMANDS.items():
        assert command.usage.split()[0] == name
        assert command.usage in listed
        assert plain(one.do(f"help {name}")) == [command.usage, f"  {command.about}"]


@pytest.mark.parametrize("typed", ["0", "-1", "x", "²", "٣", "1.5"])
def test_what_is_no_number_of_moves_is_told(typed: str) -> None:
    assert plain(debugger().do(f"step {typed}")) == [f"{typed!r} is no number of moves; write 1 or more"]


def test_a_number_of_moves_may_have_any_length() -> None:
    """It goes on until nothing happens by itself."""
    one = debugger(Script("InspectionMission"))
    rows = plain(one.do("step 1" + "0" * 5000))
    assert rows[-1] == "nothing will happen by itself; why tells what is possible"


def test_the_terminal_may_be_narrow() -> None:
    """Nothing is wider than it."""
    lines = list(answered(debugger(width=64), ["start tag_sequence=1,2", "run"]))
    assert max(map(len, lines)) <= 64


def test_a_sentence_is_told_once() -> None:
    """That a guard is false says it all where it has no parts; what can be taken stands in one line."""
    one = debugger()
    rows = plain(one.do("why"))
    assert "  always                  len(input.missing) > 0 is false" in rows
    assert "  input.battery.low       nobody listens to it here" in rows
    one.do("start tag_sequence=1")
    one.do("run SCANNING")
    rows = plain(one.do("why skip_current"))
    assert len(rows) == 1
    assert rows[0].startswith("  operator.skip_current   -> INSPECTING.PUBLISHING (visit_targets.yaml:")
    assert "  input.battery.low       input.battery.low is false" in plain(one.do("why"))


def test_variables_are_shown_with_their_values() -> None:
    """As they are now."""
    one = debugger()
    one.do("start tag_sequence=1")
    one.do("run RETURNING")
    assert plain(one.do("variables")) == [
        "  reason          done",
        "  home            {x 0, y 0, yaw 0}",
        "  unreachable     0",
    ]


def test_the_robots_clock_is_shown_and_set() -> None:
    """As everything else it can be taken back."""
    one = debugger()
    one.do("step")
    shown = ["clock", "clock 2026-01-02 06:30", "clock", "clock 22:00", "back", "clock"]
    said = [" ".join(" ".join(plain(one.do(line))).split()) for line in shown]
    assert said[0] == said[5] == "2026-01-01 00:00:00 UTC"
    assert said[1].endswith("clock (the clock was set 1.271 days forward)")
    assert said[2] == "2026-01-02 06:30:00 UTC"
    assert said[3] == "expected a date with a time of day, got '22:00'; write one such as '2026-11-22 22:00'"
    assert said[4] == "took back clock 2026-01-02 06:30"


def test_what_waits_for_a_time_of_day_is_among_the_timers(tmp_path: Path) -> None:
    """With the state that waits."""
    (tmp_path / "lifecycle.yaml").symlink_to(default_missions_folder() / "lifecycle.yaml")
    mission = tmp_path / "wake.yaml"
    mission.write_text('mission: Wake\nstates:\n  ASLEEP: {at: {"06:30": done}}\n  done: {type: final}\n')
    chart = load_chart(tmp_path / "lifecycle.yaml", [mission], shipped.catalog())
    one = Debugger(chart, Script("Wake", starts=False), make_world(chart, {}), read_value, 120)
    one.do("start")
    assert plain(one.do("timers"))[0].split("  ")[-1] == "the clock has come to it in ASLEEP"
    story = plain(one.do("run"))
    assert any("it is 06:30 in ASLEEP" in line for line in story)
    assert Tick(6.5 * 3600, "06:30") in timeline(one.simulation.result(False)).ticks
