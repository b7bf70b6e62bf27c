"""The referee notes whatever a driver reports that it should not have."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lupin_engine.plugin.contract import Code, EventKind, LiveValue, Operation, Plugin
from lupin_engine.plugin.types import BOOL, NUMBER
from lupin_harness.referee import Referee

LAMP = Plugin(
    name="lamp",
    doc="A lamp.",
    operations={
        "dim": Operation("Dim it.", result={"left": NUMBER}, codes=(Code("lamp_broken", "lamp broken"),))
    },
    values={"lamp.on": LiveValue("whether it is on", BOOL)},
    events={"burnt": EventKind("It has burnt out.", {"hours": NUMBER})},
)
ATTEMPT = "dim_1"


@pytest.fixture
def referee() -> Referee:
    """Return a referee that has begun one attempt."""
    found = Referee(LAMP)
    assert found.begin("dim") == ATTEMPT
    return found


def report(referee: Referee, *calls: Callable[[Referee], None]) -> list[str]:
    """Make reports in their order; return the problems."""
    for call in calls:
        call(referee)
    return referee.problems


def accept(referee: Referee) -> None:
    referee.accepted(ATTEMPT)


def finish(referee: Referee) -> None:
    referee.done(ATTEMPT, {"left": 0.5})


def ask(referee: Referee) -> None:
    """Let the attempt be cancelled by us."""
    referee.attempts[ATTEMPT].cancelled = True


def test_a_good_driver_is_not_blamed(referee: Referee) -> None:
    """Accepted, progress, done; a value and an event as declared; and an attempt that was to be cancelled."""
    accept(referee)
    referee.progress(ATTEMPT, "half way")
    finish(referee)
    referee.value("lamp.on", True, 12.5)
    referee.event("lamp.burnt", {"hours": 1000.0})
    second = referee.begin("dim")
    referee.attempts[second].cancelled = True
    referee.cancelled(second)
    assert referee.problems == []
    assert [attempt.reports for attempt in referee.attempts.values()] == [["accepted", "done"], ["cancelled"]]
    assert (referee.values, referee.events) == ([("lamp.on", True)], [("lamp.burnt", {"hours": 1000.0})])


@pytest.mark.parametrize(
    ("calls", "problem"),
    [
        ((accept, accept), "dim_1 is accepted twice"),
        ((finish, finish), "dim_1 reports 'done' after its end ['done']"),
        ((finish, accept), "dim_1 reports 'accepted' after its end ['done']"),
        ((finish, lambda r: r.progress(ATTEMPT, "more")), "dim_1 reports progress after its end"),
        ((lambda r: r.progress(ATTEMPT, ""),), "dim_1 reports progress without a text: ''"),
        ((lambda r: r.done(ATTEMPT, {}),), "dim_1 is done, but leaves out 'left' of the result"),
        (
            (lambda r: r.done(ATTEMPT, {"left": "some"}),),
            "dim_1 is done, but 'left': expected number, got 'some'",
        ),
        (
            (lambda r: r.done(ATTEMPT, {"left": 1.0, "right": 2.0}),),
            "dim_1 is done, but answers 'right', which is no field of the result",
        ),
        (
            (lambda r: r.failed(ATTEMPT, "lamp_brocken"),),
            "dim_1 fails with 'lamp_brocken', which is no code of its operation; did you mean 'lamp_broken'?",
        ),
        (
            (lambda r: r.cancelled(ATTEMPT),),
            "dim_1 reports that it is cancelled, and nobody asked for it",
        ),
        (
            (lambda r: r.accepted("x"),),
            "'accepted' is reported of 'x', an attempt that was never started",
        ),
        (
            (lambda r: r.value("lamp.off", True, 0.0),),
            "value 'lamp.off' is reported and not declared; did you mean 'lamp.on'?",
        ),
        ((lambda r: r.value("lamp.on", 1, 0.0),), "value 'lamp.on': expected bool, got 1"),
        (
            (lambda r: r.value("lamp.on", True, float("nan")),),
            "value 'lamp.on' has the stamp nan; it must be seconds",
        ),
        (
            (lambda r: r.event("burnt", {"hours": 1.0}),),
            "event 'burnt' is reported and not declared; did you mean 'lamp.burnt'?",
        ),
        (
            (lambda r: r.event("lamp.burnt", {}),),
            "event 'lamp.burnt': hours of lamp.burnt left out",
        ),
        ((lambda r: setattr(r, "closed", True), accept), "'accepted' of dim_1 is reported after close"),
        (
            (lambda r: setattr(r, "closed", True), lambda r: r.value("lamp.on", True, 0.0)),
            "value 'lamp.on' is reported after close",
        ),
    ],
)
def test_what_breaks_the_contract_is_noted(
    referee: Referee, calls: tuple[Callable[[Referee], None], ...], problem: str
) -> None:
    """At once, with what was reported."""
    assert report(referee, *calls) == [problem]


def test_an_attempt_that_is_accepted_too_late_is_cancelled_again() -> None:
    """As the engine does it."""
    again: list[str] = []
    referee = Referee(LAMP, again.append)
    referee.begin("dim")
    ask(referee)
    accept(referee)
    assert (again, referee.problems) == ([ATTEMPT], [])
