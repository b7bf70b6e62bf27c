"""Why: what became of a target, how a state was come to, where the run was at a moment."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest

from lupin_engine.machine.machine import Machine
from lupin_engine.replay.why import Explanation, GuardWitness, Inquiry, LivedStep, NothingKnown
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Happening, Script, simulate
from tests import shipped

#: What the clock on the wall showed when the run began.
BEGAN = 1_767_225_600.0
TRIES = {"nav_max_attempts": 2}
TAG_2_IS_BLOCKED = Rule(
    "nav.go_to", (MockOutcome(code="nav_status_6", detail="no path", after=2.0),), target="2"
)


def lived(*rules: Rule, happenings: Sequence[Happening] = ()) -> list[LivedStep]:
    """Simulate three tags, and live through the steps again with a witness of the conditions."""
    chart, witness = shipped.mission("inspection"), GuardWitness()
    script = Script(
        "InspectionMission", {"tag_sequence": ["1", "2", "3"]}, rules=rules, happenings=tuple(happenings)
    )
    machine = Machine(make_world(witness.prepare(chart), TRIES))
    found = []
    for step in simulate(chart, script, TRIES).steps:
        if step.event.name == "start":
            again = machine.start(step.time, step.event.data.get("ahead"))
        elif step.event.name.startswith("timer."):
            again = machine.advance(step.time)  # type: ignore[assignment]
        else:
            again = machine.handle(step.event, step.time)
        assert (again.taken, again.commands) == (step.taken, step.commands)
        by = "ann@bench" if step.accepted is not None else ""
        held = tuple(machine.memory.held)
        found.append(LivedStep(again, BEGAN + step.time, by, held, witness.of(again)))
    return found


def told(answer: Explanation) -> list[str]:
    """Write it down: the sentence, then each step with its reasons, without the numbers of lines."""
    lines = [answer.text]
    for cause in answer.causes:
        lines.append(f"{cause.line.time:.1f} s {cause.line.event}" + (f" by {cause.by}" if cause.by else ""))
        lines += [re.sub(r":\d+", "", f"  {reason}", count=1) for reason in cause.reasons]
    return lines


def test_a_target_that_was_not_reached_tells_its_tries_and_what_decided() -> None:
    inquiry = Inquiry(shipped.mission("inspection"), lived(TAG_2_IS_BLOCKED))
    assert told(inquiry.target("2")) == [
        "tag 2 is UNREACHABLE (nav_status_6: no path)",
        "3.7 s time is up in INSPECTING.SCANNING.DWELLING",
        "  visit_targets.yaml",
        "  visit_targets.yaml: itinerary.remaining > 0 and unreachable < itinerary.total"
        " (itinerary.remaining was 2, context.unreachable was 0, itinerary.total was 3)",
        "  visit_targets.yaml: not param.arm_patrol_enabled (param.arm_patrol_enabled was false)",
        "5.7 s nav.go_to failed: nav_status_6 no path",
        "6.7 s next try",
        "8.7 s nav.go_to failed: nav_status_6 no path",
        "  visit_targets.yaml",
        "  visit_targets.yaml: itinerary.remaining > 0 and unreachable < itinerary.total"
        " (itinerary.remaining was 1, context.unreachable was 1, itinerary.total was 3)",
        "  visit_targets.yaml: not param.arm_patrol_enabled (param.arm_patrol_enabled was false)",
    ]


def test_a_target_that_was_given_up_tells_who_said_so() -> None:
    skip = Happening(Ask("operator.skip_current"), after=4.0)
    answer = Inquiry(shipped.mission("inspection"), lived(happenings=[skip])).target("2")
    assert answer.text == "tag 2 is SKIPPED (skipped_by_operator)"
    assert "4.0 s operator.skip_current accepted by ann@bench" in told(answer)


def test_a_state_leads_back_to_what_brought_it_about() -> None:
    inquiry = Inquiry(shipped.mission("inspection"), lived(), depth=3)
    assert told(inquiry.state("SCANNING")) == [
        "SCANNING was come to at 9.9 s",
        "9.9 s nav.go_to done",
        "  visit_targets.yaml",
        "6.9 s time is up in INSPECTING.SCANNING.DWELLING",
        "  visit_targets.yaml",
        "  visit_targets.yaml: itinerary.remaining > 0 and unreachable < itinerary.total"
        " (itinerary.remaining was 1, context.unreachable was 0, itinerary.total was 3)",
        "  visit_targets.yaml: not param.arm_patrol_enabled (param.arm_patrol_enabled was false)",
        "6.9 s bridge.read_tag done",
        "  visit_targets.yaml",
    ]


def test_a_moment_tells_where_it_was_and_what_it_waited_for() -> None:
    inquiry = Inquiry(shipped.mission("inspection"), lived(TAG_2_IS_BLOCKED), depth=1)
    assert told(inquiry.moment(BEGAN + 8.0))[0] == (
        "in INSPECTING.NAVIGATING.DRIVING for 4.3 s; under way: nav.go_to for 1.3 s (try 2)"
    )
    held = Inquiry(
        shipped.mission("inspection"),
        lived(happenings=[Happening(Ask("operator.pause"), after=4.0)]),
        depth=1,
    )
    assert told(held.moment(BEGAN + 60.0)) == [
        "in INSPECTING.NAVIGATING.DRIVING for 56.3 s; held by pause",
        "3.7 s time is up in INSPECTING.SCANNING.DWELLING",
        "  visit_targets.yaml",
        "  visit_targets.yaml: itinerary.remaining > 0 and unreachable < itinerary.total"
        " (itinerary.remaining was 2, context.unreachable was 0, itinerary.total was 3)",
        "  visit_targets.yaml: not param.arm_patrol_enabled (param.arm_patrol_enabled was false)",
    ]


@pytest.mark.parametrize(
    ("question", "text"),
    [
        (lambda run: run.state("DOCKD"), "no state is called 'DOCKD'; did you mean 'DOCKED'?"),
        (lambda run: run.state("DOCKED"), "this run did not come to DOCKED"),
        (lambda run: run.target("9"), "this run knows of no tag '9'; allowed: '1', '2', '3'"),
        (lambda run: run.moment(BEGAN - 1.0), "this run had not begun then"),
        (lambda run: run.breach("ends_at_home"), "this run did not break ends_at_home"),
        (
            lambda run: run.breach("ends_at_hom"),
            "no property is called 'ends_at_hom'; did you mean 'ends_at_home'?\n"
            f"properties: {', '.join(sorted(shipped.mission('inspection').properties))}",
        ),
    ],
)
def test_what_a_run_does_not_know_it_says(question, text: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(NothingKnown) as raised:
        question(Inquiry(shipped.mission("inspection"), lived()))
    assert str(raised.value) == text
