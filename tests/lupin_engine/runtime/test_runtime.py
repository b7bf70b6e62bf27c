"""The loop between a machine and its plugins, its clock, its records, and how a machine is made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pytest

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step
from lupin_engine.plugin.builtin import TIME_ZONE
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import COUNT, DURATION, NUMBER, TEXT
from lupin_engine.runtime.clock import VirtualClock, calendar_of
from lupin_engine.runtime.engine import Engine, EngineOutlet
from lupin_engine.runtime.record import step_record, view_record
from lupin_engine.runtime.setup import check_parameters, make_machine
from tests import shipped
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import Bench, chart


class Server:
    """A driver that notes what it is told and may answer, or fail, at once."""

    def __init__(self, **answers: Any) -> None:
        self.told: list[str] = []
        self.answers = answers
        self.outlet: EngineOutlet | None = None

    def missing(self) -> list[str]:
        """Nothing."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Note a request; answer at once when told to."""
        self._note(f"start {operation}")
        if "at_once" in self.answers and self.outlet is not None:
            self.outlet.accepted(attempt)
            self.outlet.done(attempt, self.answers["at_once"])

    def cancel(self, attempt: str) -> None:
        """Note a cancel."""
        self._note("cancel")

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Note an action."""
        self._note(f"act {action}")

    def close(self) -> None:
        """Nothing."""

    def _note(self, text: str) -> None:
        self.told.append(text)
        if "raises" in self.answers:
            raise OSError(self.answers["raises"])


def loop(states: dict[str, Any], **drivers: Server) -> tuple[Engine, VirtualClock, list[Step]]:
    """Return a started loop over `states` with its clock and the steps that it makes."""
    steps: list[Step] = []
    clock = VirtualClock()
    engine = Engine(Machine(World(chart(states), {}, {}, {})), clock, drivers, steps.append)
    for server in drivers.values():
        server.outlet = EngineOutlet(engine, engine.drain)
    engine.start()
    return engine, clock, steps


DRIVING = {
    "A": {
        "invoke": {"do": "nav.go", "timeout": 5.0, "timeout_code": "late"},
        "on_done": "B",
        "on_error": "C",
        "on": {"away": "B"},
    },
    "B": {"entry": "nav.wave"},
    "C": {},
}


def test_commands_reach_the_plugin_that_they_name() -> None:
    """Operations and actions go to their driver under their local names."""
    server = Server()
    engine, _, _ = loop(DRIVING, nav=server)
    engine.post(Event("away"))
    engine.drain()
    assert server.told == ["start go", "cancel", "act wave"] or server.told == [
        "start go",
        "act wave",
        "cancel",
    ]


def test_an_answer_from_within_a_command_is_a_step_of_its_own() -> None:
    """A driver that answers at once does not step the machine inside a step."""
    _, _, steps = loop(DRIVING, nav=Server(at_once={}))
    assert [step.event.name for step in steps] == ["start", "attempt.accepted", "attempt.done"]
    assert [step.sequence for step in steps] == [1, 2, 3]


def test_a_driver_that_raises_fails_its_attempt() -> None:
    """A plugin that breaks is an error that the chart handles, not the end of the loop."""
    engine, _, steps = loop(DRIVING, nav=Server(raises="no network"))
    assert steps[-1].event.data["code"] == "driver_error"
    assert steps[-1].event.data["detail"] == "OSError: no network"
    assert engine.machine.view.lifecycle == "C"


def test_a_plugin_that_is_not_there_fails_the_attempt() -> None:
    """An operation without a driver ends in an error at once."""
    engine, _, _ = loop(DRIVING)
    assert engine.machine.view.lifecycle == "C"


def test_an_action_that_fails_is_told() -> None:
    """An action is not waited for, but its failure stands in the record."""
    _, _, steps = loop({"A": {"entry": "nav.wave"}}, nav=Server(raises="no network"))
    assert steps[-1].event.name == "driver.failed"
    assert steps[-1].event.data == {"command": "nav.wave", "detail": "OSError: no network"}


def test_a_listener_that_fails_keeps_no_cancel_from_being_sent() -> None:
    """Whatever breaks in telling of a step: the robot is stopped."""
    server = Server()
    engine, _, steps = loop(DRIVING, nav=server)

    def fail(step: Step) -> None:
        steps.append(step)
        raise OSError("cannot publish")

    engine.listener = fail
    engine.post(Event("away"))
    with pytest.raises(OSError, match="cannot publish"):
        engine.drain()
    assert "cancel" in server.told


def test_deadlines_go_before_what_is_queued() -> None:
    """What was due before an event arrived is done before it."""
    engine, clock, steps = loop(DRIVING, nav=Server())
    clock.move_to(6.0)
    engine.post(Event("away"))
    engine.drain()
    assert [step.event.name for step in steps] == ["start", "timer.timeout", "away"]
    assert engine.machine.view.lifecycle == "C"


def test_a_request_is_answered_by_its_own_step() -> None:
    """What is queued and due comes first; the step returned is the request's."""
    engine, _, steps = loop({"A": {"on": {"go": "B"}}, "B": {"on": {"operator.abort": "A"}}})
    engine.post(Event("go"))
    step = engine.request(Event("operator.abort"))
    assert step.accepted
    assert [each.event.name for each in steps] == ["start", "go", "operator.abort"]


def test_the_listener_hears_a_step_before_its_commands_are_carried_out() -> None:
    """What a driver causes is recorded after what caused it."""
    heard: list[str] = []
    server = Server()
    server._note = heard.append  # type: ignore[method-assign]
    machine = Machine(World(chart(DRIVING), {}, {}, {}))
    Engine(machine, VirtualClock(), {"nav": server}, lambda step: heard.append(step.event.name)).start()
    assert heard == ["start", "start go"]


def test_what_must_stop_is_told_so_before_the_listener_hears_of_it() -> None:
    """Telling takes longer than a cancel, and the robot drives on meanwhile."""
    server = Server()
    engine, _, _ = loop({**DRIVING, "B": {}}, nav=server)
    heard: list[list[str]] = []
    engine.listener = lambda step: heard.append(list(server.told))
    engine.post(Event("away"))
    engine.drain()
    assert heard == [["start go", "cancel"]]


def test_the_virtual_clock_does_not_go_back() -> None:
    """The refusal names both times."""
    clock = VirtualClock()
    clock.move_to(5.0)
    with pytest.raises(ValueError, match="stands at 5 s and cannot go back to 4 s"):
        clock.move_to(4.0)


# -- records ----------------------------------------------------------------------------------------------


def test_a_record_is_json_without_what_is_empty() -> None:
    """Steps and views survive the way through JSON."""
    bench = Bench(chart(DRIVING))
    step = bench.send("operator.abort")
    record = json.loads(json.dumps(step_record(step)))
    assert record == {
        "sequence": 2,
        "time": 0.0,
        "event": "operator.abort",
        "configuration": ["", "A"],
        "accepted": False,
        "refusal": {"code": "not_possible", "text": "abort is not possible in A"},
    }
    assert json.loads(json.dumps(view_record(bench.machine.view, bench.machine.chart)))["lifecycle"] == "A"


# -- setup ------------------------------------------------------------------------------------------------

DECLARED = {
    "limit_s": Parameter(DURATION, 5.0, "", minimum=1.0, maximum=60.0),
    "tries": Parameter(COUNT, 2, ""),
    "share": Parameter(NUMBER, 0.5, ""),
    "name": Parameter(TEXT, "home", ""),
}


def test_parameters_have_defaults_and_units() -> None:
    """What is given is converted to base units, what is not keeps its default."""
    found = check_parameters(DECLARED, {"limit_s": "1 min", "tries": 3})
    assert found == {"limit_s": 60.0, "tries": 3, "share": 0.5, "name": "home"}


def test_all_wrong_parameters_are_told_at_once() -> None:
    """Every problem has its line: nearest name, type, range."""
    with pytest.raises(UsageError) as caught:
        check_parameters(DECLARED, {"limit": 1, "limit_s": 0.5, "tries": "two", "name": 3})
    assert str(caught.value).splitlines() == [
        "unknown parameter 'limit'; did you mean 'limit_s'?",
        "parameter 'limit_s': expected duration between 1 and 60 s, got 0.5",
        "parameter 'tries': expected count, got 'two'",
        "parameter 'name': expected text, got 3",
    ]


def test_a_plugin_that_cannot_work_says_so() -> None:
    """A layout file that is not there is the user's to mend, and told before anything runs."""
    given = {"tag_locations_file": "/nowhere/layout.json"}
    with pytest.raises(LupinError, match=r"tag_locations_file .* cannot be used"):
        make_machine(shipped.mission("inspection"), given)


# -- the robot's clock ------------------------------------------------------------------------------------


def test_a_clock_that_is_set_is_told_once_and_one_that_is_slewed_is_not() -> None:
    """Half a second is what a machine may be wrong by."""
    steps: list[Step] = []
    clock = VirtualClock(100.0, 1_000_000.0)
    machine = Machine(World(chart({"A": {}}), {}, calendar=calendar_of("UTC")))
    engine = Engine(machine, clock, {}, steps.append, clock.wall)
    engine.start()
    clock.set_wall(1_000_000.4)
    engine.drain()
    clock.move_to(110.0)
    clock.set_wall(1_003_610.0)
    engine.drain()
    engine.drain()
    assert [(step.event.name, step.event.data, step.notes) for step in steps] == [
        ("start", {"ahead": 999_900.0}, ("the clock says 1970-01-12 13:46:40 UTC",)),
        (
            "clock",
            {"ahead": 1_003_500.0},
            ("the clock was set 1 h forward", "the clock says 1970-01-12 14:46:50 UTC"),
        ),
    ]


def test_a_clock_that_is_not_known_yet_is_told_when_it_is() -> None:
    """As simulated time, of which nobody has heard at the start: no time of day is passed over by that."""
    steps: list[Step] = []
    known: list[float] = []
    states = {"A": {"at": {"06:30": "B"}}, "B": {}}
    machine = Machine(World(chart(states), {}, calendar=calendar_of("UTC")))
    engine = Engine(machine, VirtualClock(), {}, steps.append, lambda: known[-1] if known else None)
    engine.start()
    known.append(calendar_of("UTC").moment("2026-11-22 22:00"))
    engine.drain()
    assert steps[-1].notes == ("the clock says 2026-11-22 22:00:00 UTC",)
    assert (machine.memory.configuration, engine.next_deadline) == (("", "A"), 8.5 * 3600)


def test_missions_that_do_not_read_the_clock_have_no_zone() -> None:
    """So nobody is asked for one; with one, a name that is none is refused."""
    assert TIME_ZONE not in shipped.mission("inspection").parameters
    words = pictured.chart("words")
    with pytest.raises(UsageError, match=r"there is no time zone 'Mars'; write one such as Europe/Amsterdam"):
        make_machine(words, {TIME_ZONE: "Mars"})
    assert make_machine(words, {TIME_ZONE: "Asia/Tokyo"}).world.calendar is not None
