"""Commands as the command service reads and remembers them: no ROS, and time is an argument."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.machine.event import Event
from lupin_engine.machine.step import Refusal, Step
from lupin_ros.service.commands import (
    ID_IN_USE,
    MAX_REMEMBERED,
    MAX_REQUEST,
    MAX_WORD,
    REMEMBERED_S,
    TOO_MANY,
    CommandAnswer,
    CommandMemory,
    CommandRequest,
    answered,
    counts_however_late,
    read_command,
)
from tests import shipped

INSPECTION = shipped.mission("inspection")
DONE = CommandAnswer(True, "", "pause accepted", step=7)


def read(verb: str, mission: str = "", request: Any = "", **more: str) -> Event | Refusal:
    """Read a command for the inspection."""
    text = request if isinstance(request, str) else json.dumps(request)
    return read_command(CommandRequest(verb, mission, text, **more), INSPECTION, "lupin-1")


# -- reading ----------------------------------------------------------------------------------------------

TAGS = {"tag_sequence": ["1", "5"]}
NAMES = {"mission_type": "InspectionMission", "mission_id": "lupin-1"}


@pytest.mark.parametrize(
    ("command", "event"),
    [
        (("start", "InspectionMission", TAGS), Event("mission.start", {**TAGS, **NAMES})),
        (("start", "InspectionMission"), Event("mission.start", NAMES)),
        (
            ("start", "InspectionMission", {"tag_sequence": []}),
            Event("mission.start", {"tag_sequence": [], **NAMES}),
        ),
        # The machine knows what is wrong with that.
        (("start", "Dance", {"x": 1}), Event("mission.start", {"x": 1, **NAMES, "mission_type": "Dance"})),
        (("pause",), Event("operator.pause")),
        (("skip_current", "", {}), Event("operator.skip_current")),
        (("skip",), Event("operator.skip_current")),
        (("answer", "", {"choice": "stay"}), Event("answer.stay")),
        (("answer", "", {"choice": "x" * 9000}), Event("answer." + "x" * 40 + "...")),
    ],
)
def test_a_command_is_an_event(command: tuple[Any, ...], event: Event) -> None:
    """Requests of the profile go by their name or by their verb."""
    assert read(*command) == event


@pytest.mark.parametrize(
    ("command", "code", "text"),
    [
        (("paus",), "unknown_verb", "unknown verb 'paus'; did you mean 'pause'?"),
        (("",), "unknown_verb", None),
        (("mission.start",), "unknown_verb", None),
        (
            ("start", "InspectionMission", "{"),
            "bad_request",
            "start refused: its request is no JSON: Expecting property name enclosed in double quotes: "
            "line 1 column 2 (char 1)",
        ),
        (
            ("start", "InspectionMission", "[" * 60_000),
            "bad_request",
            "start refused: its request is no JSON: it is nested too deep",
        ),
        (
            ("start", "InspectionMission", '{"tag_sequence": NaN}'),
            "bad_request",
            "start refused: its request is no JSON: NaN is no number of JSON",
        ),
        (
            ("start", "InspectionMission", '{"tag_sequence": [-1e999]}'),
            "bad_request",
            "start refused: its request is no JSON: -1e999 is no number of JSON",
        ),
        (
            ("start", "InspectionMission", '{"tag_sequence": ["\\ud800"]}'),
            "bad_request",
            "start refused: its request has half of a character, which no message can carry",
        ),
        (
            ("start", "InspectionMission", [1]),
            "bad_request",
            "start refused: its request must be a JSON object, such as {}",
        ),
        (
            ("start", "InspectionMission", {"tag_sequnce": [], "speed": 1}),
            "bad_request",
            "start refused: unknown field 'tag_sequnce'; did you mean 'tag_sequence'?; "
            "unknown field 'speed'; allowed: 'tag_sequence'",
        ),
        (
            ("start", "InspectionMission", {f"f{n}": n for n in range(1000)}),
            "bad_request",
            "start refused: "
            + "; ".join(f"unknown field 'f{n}'; allowed: 'tag_sequence'" for n in range(5))
            + " and 995 more",
        ),
        (
            ("pause", "InspectionMission"),
            "bad_request",
            "pause refused: it is for whatever mission runs, so it names none",
        ),
        (
            ("pause", "", {"for": 3}),
            "bad_request",
            "pause refused: unknown field 'for'; it has none",
        ),
        (("answer",), "bad_request", 'answer refused: say what, as {"choice": NAME}'),
        (("answer", "", {"choice": 3}), "bad_request", 'answer refused: say what, as {"choice": NAME}'),
        (
            ("pause", "", " " * (MAX_REQUEST + 1)),
            "bad_request",
            "refused: too long: request has 65537 letters, at most 65536",
        ),
        (
            ("p" * 201, "m" * 300),
            "bad_request",
            "refused: too long: verb has 201 letters, at most 200, mission has 300 letters, at most 200",
        ),
    ],
)
def test_what_cannot_be_read_is_refused(command: tuple[Any, ...], code: str, text: str | None) -> None:
    """With what is wrong, all of it, and what is allowed or was meant."""
    refusal = read(*command)
    assert isinstance(refusal, Refusal)
    assert refusal.code == code
    assert text is None or refusal.text == text


@given(
    verb=st.sampled_from(["start", "answer", "pause", "skip", ""]) | st.text(),
    mission=st.sampled_from(["", "InspectionMission"]) | st.text(),
    request=st.text() | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(json.dumps),
)
def test_whatever_comes_is_an_event_or_a_refusal(verb: str, mission: str, request: str) -> None:
    """And a refusal fits on a screen."""
    found = read(verb, mission, request, by="x", command_id="y")
    assert isinstance(found, Event) or (found.code and found.text.isprintable() and len(found.text) < 500)


def test_who_commands_cannot_write_over_the_log() -> None:
    """What is no letter is not repeated, and no more than is read."""
    assert CommandRequest("pause").origin == {}
    asked = CommandRequest("pause", by="ann\x1b[2J\n@bench" + "x" * 9000, command_id="7")
    assert asked.origin == {"by": ("ann?[2J?@bench" + "x" * 9000)[:MAX_WORD], "command_id": "7"}


# -- once -------------------------------------------------------------------------------------------------


class Desk:
    """Commands at moments, and how many were carried out."""

    def __init__(self) -> None:
        self.memory = CommandMemory()
        self.done: list[str] = []

    def ask(self, now: float, command_id: str, verb: str = "pause", by: str = "") -> CommandAnswer:
        asked = CommandRequest(verb, command_id=command_id, by=by)
        return self.memory.once(asked, INSPECTION, now, self._carry_out)

    def _carry_out(self, asked: CommandRequest) -> CommandAnswer:
        self.done.append(asked.verb)
        return CommandAnswer(True, "", f"{asked.verb} accepted", step=len(self.done))


def test_the_same_id_is_carried_out_once_in_a_minute() -> None:
    """The answer is that of the first time, and says so; also when somebody else sends it."""
    desk = Desk()
    assert desk.ask(100.0, "a") == CommandAnswer(True, "", "pause accepted", step=1)
    again = CommandAnswer(True, "", "pause accepted", step=1, repeated=True)
    assert desk.ask(100.0 + REMEMBERED_S, "a", by="bob") == again
    assert desk.ask(100.1 + REMEMBERED_S, "a") == CommandAnswer(True, "", "pause accepted", step=2)


def test_without_an_id_every_command_is_carried_out() -> None:
    """So is one whose id is too long to be kept."""
    desk = Desk()
    for command_id in ("", "", "x" * 201, "x" * 201):
        assert not desk.ask(0.0, command_id).repeated
    assert len(desk.done) == 4


def test_a_command_that_was_broken_off_is_not_begun_again() -> None:
    """What raised an exception may have been carried out all the same."""
    memory, begun = CommandMemory(), []

    def carry_out(asked: CommandRequest) -> CommandAnswer:
        begun.append(asked)
        raise RuntimeError("boom")

    asked = CommandRequest("dock", command_id="a")
    with pytest.raises(RuntimeError):
        memory.once(asked, INSPECTION, 0.0, carry_out)
    again = memory.once(asked, INSPECTION, 1.0, carry_out)
    assert (again.accepted, again.code, again.repeated) == (False, "broken_off", True)
    assert begun == [asked]


def test_an_id_belongs_to_one_command() -> None:
    """A stop must not be taken for done because a pause was."""
    desk = Desk()
    desk.ask(0.0, "a", "pause")
    refused = desk.ask(1.0, "a", "abort")
    assert (refused.accepted, refused.code) == (False, ID_IN_USE)
    assert refused.message == "refused: the command id 'a' was another command's"
    assert desk.done == ["pause"]


def test_the_memory_is_bounded() -> None:
    """No id is forgotten within its minute: new ones are refused, and only a pause never is."""
    desk = Desk()
    for number in range(MAX_REMEMBERED):
        desk.ask(0.0, str(number), "dock")
    refused = desk.ask(REMEMBERED_S, "new", "resume")
    told = "refused: 1000 commands came within 60 s; wait for a moment"
    assert refused == CommandAnswer(False, TOO_MANY, told)
    assert desk.ask(REMEMBERED_S, "0", "dock").repeated
    assert desk.ask(REMEMBERED_S, "halt", "pause").accepted
    assert desk.ask(REMEMBERED_S, "", "resume").accepted  # who gives no id takes care itself
    assert len(desk.memory._known) == MAX_REMEMBERED
    assert desk.ask(REMEMBERED_S + 0.1, "new", "resume").accepted


def test_the_next_process_knows_what_was_commanded() -> None:
    """With its answer; what was broken off is not done again either, whatever is commanded under its id."""

    class Kept(dict[str, tuple[str, Mapping[str, Any]]]):
        def answered(self, command_id: str, what: str, answer: Mapping[str, Any]) -> None:
            self[command_id] = what, answer

    kept, first, desk = Kept(), Desk(), Desk()
    first.memory = CommandMemory(kept)
    first.ask(0.0, "a")
    first.ask(1.0, "", "dock")
    assert list(kept) == ["a"]
    desk.memory.remember("a", 100.0, *kept["a"])
    desk.memory.remember("b", 101.0, "", {})
    again = CommandAnswer(True, "", "pause accepted", step=1, repeated=True)
    assert desk.ask(110.0, "a") == again
    assert desk.ask(110.0, "a", "dock").code == ID_IN_USE
    told = "it was begun and broken off: look at the state"
    assert desk.ask(110.0, "b") == CommandAnswer(False, "broken_off", told, repeated=True)
    assert desk.done == []
    assert desk.ask(100.1 + REMEMBERED_S, "a").step == 1
    assert desk.done == ["pause"]


def test_what_counts_however_late() -> None:
    """Stopping late is better than not at all; what was done already is answered at any time."""
    names = ("pause", "abort", "dock", "resume", "skip_current", "reset", "x")
    late = [name for name in names if counts_however_late(f"operator.{name}", INSPECTION)]
    assert late == ["pause", "abort", "dock"]
    desk = Desk()
    desk.ask(0.0, "a", "resume")
    assert desk.memory.knows(CommandRequest("resume", command_id="a"), 1.0)
    assert not desk.memory.knows(CommandRequest("resume", command_id="b"), 1.0)


# -- answering --------------------------------------------------------------------------------------------


def test_an_answer_is_the_sentence_of_the_step() -> None:
    """With its number, so that it is found in the record."""
    start = CommandRequest("start", "InspectionMission")
    begun = Step(4, 0.0, Event("mission.start", NAMES), (), accepted=True)
    assert answered(start, begun) == CommandAnswer(
        True, "", "InspectionMission lupin-1 started", mission_id="lupin-1", step=4
    )
    paused = Step(7, 0.0, Event("operator.pause"), (), accepted=True)
    assert answered(CommandRequest("pause"), paused) == DONE
    skipped = replace(paused, event=Event("operator.skip_current"))
    for word in ("skip", "skip_current"):
        assert answered(CommandRequest(word), skipped).message == f"{word} accepted"
    chosen = replace(paused, event=Event("answer.go_on"))
    assert answered(CommandRequest("answer"), chosen).message == "go_on accepted"
    no = Step(
        8, 0.0, Event("operator.pause"), (), accepted=False, refusal=Refusal("not_running", "no mission")
    )
    assert answered(CommandRequest("pause"), no) == CommandAnswer(False, "not_running", "no mission", step=8)
