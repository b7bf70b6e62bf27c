"""A server that refuses to end what it does: nothing begins beside it, and resume is refused, with why."""

from __future__ import annotations

from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.machine import event as events
from lupin_engine.machine.event import RESUMED, Event
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import CANCEL_DEADLINE, MAX_LOST, REFUSAL_LIMIT
from lupin_engine.plugin.contract import REFUSED_CODE
from lupin_engine.runtime.possible import RequestPreview
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

TOLD = "the robot may be moving"
STATES: dict[str, Any] = {
    "A": {
        "invoke": "nav.go",
        "on": {
            "operator.skip_current": "B",
            "operator.abort": {"target": "HOME", "releases": ["pause"]},
            "operator.dock": {"target": "B", "releases": ["pause"]},
        },
    },
    "B": {"invoke": "nav.dock"},
    "HOME": {"invoke": "nav.home"},
}


def paused() -> tuple[Bench, str]:
    """Return a bench that is paused while its drive refuses to end, and the attempt."""
    bench = Bench(chart(STATES, holds={"pause": PAUSE}))
    old = bench.attempt
    bench.send(events.accepted(old))
    bench.send("operator.pause")
    bench.send(events.cancel_refused(old, TOLD))
    return bench, old


def test_it_is_reported_after_a_second_and_once() -> None:
    bench, _ = paused()
    assert bench.wait(REFUSAL_LIMIT - 0.1) == []
    assert bench.machine.view.code == ""
    (step,) = bench.wait(100.0)
    assert [(c.code, c.detail, c.severity) for c in step.codes] == [(REFUSED_CODE, TOLD, Severity.ERROR)]
    assert bench.machine.view.cancelling == ("nav.go",)


def test_resume_is_refused_with_the_reason_until_the_drive_has_ended() -> None:
    bench, old = paused()
    foresight = RequestPreview(bench.machine)

    def foreseen() -> str:
        told = foresight.news(bench.now) or []
        return next((one["reason"] for one in told if one["verb"] == "resume"), "as before")

    step = bench.send("operator.resume")
    assert step.refusal is not None
    assert (step.refusal.code, step.refusal.text) == (REFUSED_CODE, f"resume refused: {TOLD}")
    assert foreseen() == f"resume refused: {TOLD}"
    assert bench.machine.memory.held == ["pause"]
    bench.send(events.cancelled(old))
    assert foreseen() == ""
    assert bench.send("operator.resume").accepted
    assert bench.attempt != old


def test_the_next_one_waits_longer_than_a_deadline() -> None:
    bench = Bench(chart(STATES, holds={"pause": PAUSE}))
    old = bench.attempt
    bench.send("operator.skip_current")
    bench.send(events.cancel_refused(old, TOLD))
    bench.wait(10 * CANCEL_DEADLINE)
    assert bench.attempt == old
    bench.send(events.done(old, {}))
    assert [start.operation for start in bench.started] == ["nav.go", "nav.dock"]


def test_what_replaces_begins_beside_it_and_nothing_else_does() -> None:
    for request, begins in (("operator.abort", ["nav.home"]), ("operator.dock", [])):
        bench, _ = paused()
        assert bench.send(request).accepted
        assert [start.operation for start in bench.started[1:]] == begins


def test_what_replaces_waits_for_an_answer_all_the_same() -> None:
    """Only a refusal lets it go first: a cancel that may still come would end it."""
    bench = Bench(chart(STATES, holds={"pause": PAUSE}))
    bench.send("operator.abort")
    assert len(bench.started) == 1
    bench.send(events.cancel_refused(bench.started[0].attempt, TOLD))
    assert bench.started[-1].operation == "nav.home"


def test_a_refusal_after_the_deadline_takes_the_resource_back() -> None:
    bench = Bench(chart(STATES, holds={"pause": PAUSE}))
    old = bench.attempt
    bench.send("operator.pause")
    bench.wait(CANCEL_DEADLINE)
    assert bench.machine.memory.attempts[old].phase is Phase.LOST
    bench.send(events.cancel_refused(old, TOLD))
    assert not bench.send("operator.resume").accepted


def test_another_process_asks_again() -> None:
    """Until it knows better nothing begins at all; then the drive keeps what it uses."""
    bench, old = paused()
    bench.restart()
    bench.send(Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
    assert bench.commands == [f"cancel {old}"]
    assert bench.machine.memory.attempts[old].uses == ("*",)
    bench.send(events.cancel_refused(old, TOLD))
    assert bench.machine.memory.attempts[old].phase is Phase.REFUSED
    assert not bench.send("operator.resume").accepted


def test_who_drives_on_after_the_end_is_reported_while_held() -> None:
    bench, old = paused()
    bench.send(events.cancelled(old))
    assert bench.send(events.cancel_refused(old, TOLD)).codes[0].code == REFUSED_CODE
    assert bench.send("operator.resume").accepted
    assert bench.send(events.cancel_refused(old, TOLD)).codes == ()


def test_what_gives_a_result_is_waited_for_as_long_as_it_may_refuse() -> None:
    """The state hears then that nothing came: a server that never ends holds up no step of the mission."""
    invoke = {"do": "valve.give", "timeout": 5.0}
    bench = Bench(chart({"A": {"invoke": invoke, "on_error": "B"}, "B": {}}))
    bench.wait(5.0)
    bench.send(events.cancel_refused(bench.attempt, TOLD))
    assert bench.leaves == ["A"]
    bench.wait(REFUSAL_LIMIT)
    assert bench.leaves == ["B"]


def test_those_that_keep_nothing_are_remembered_up_to_a_number() -> None:
    """A server that never ends fills no memory; what keeps a resource is never forgotten."""
    states = {"A": {"invoke": "bridge.read", "on": {"away": "B"}}, "B": {"on": {"again": "A"}}}
    bench = Bench(chart(states))
    for _ in range(MAX_LOST + 3):
        old = bench.attempt
        bench.send("away")
        bench.send(events.cancel_refused(old, TOLD))
        bench.send("again")
    bench.wait(REFUSAL_LIMIT)
    assert len(bench.machine.memory.attempts) == MAX_LOST + 1
