"""The client of bindings over real services: what is sent, what an answer means, and when there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovariance
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import SetBool, Trigger

from lupin_engine.errors import LupinError
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import COUNT, DURATION, NUMBER, TEXT, Type, list_of
from lupin_ros.adapter.node import RosNode, peer_mismatches
from lupin_ros.interfaces.definitions import (
    fill,
    installed_types,
    interface_class,
    interface_types,
    plain,
)
from lupin_ros.orchestrator import binding_client as bound_client
from lupin_ros.orchestrator.binding_client import BoundClient
from tests.lupin_ros.helpers import PATIENCE, spin_for, spin_until
from tests.lupin_ros.orchestrator.bound import binding_of
from tests.plugins.fakes import FakeOutlet

MakeNode = Callable[..., RosNode]


LAMP = """
binding: lamp
summary: A lamp.
codes:
  lamp_failed: {label: no light}
  lamp_gone: {label: no lamp}
operations:
  switch:
    summary: Switch it.
    arguments:
      on: {type: bool, summary: on or off}
    service: {name: /lamp, type: std_srvs/srv/SetBool}
    with: {data: "${ on }"}
    done_when: response.success
    detail: ${ response.message }
    result:
      said: {type: text, from: "${ response.message }"}
    code: lamp_failed
    unavailable: lamp_gone
    mock: {result: {said: lit}}
"""


class Bench:
    """A client, and where a lamp may stand."""

    def __init__(self, make_node: MakeNode, *changes: tuple[str, str], arguments: Sequence[str] = ()) -> None:
        text = LAMP
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        self._make = make_node
        self.nodes = [make_node("engine", arguments)]
        self.outlet = FakeOutlet()
        self.asked: list[bool] = []
        self.client = BoundClient(self.nodes[0], binding_of(text), self.outlet, {})

    def serve(self, answers: bool = True, success: bool = True) -> None:
        """Let a lamp appear."""

        def switch(request: Any, response: Any) -> Any:
            self.asked.append(request.data)
            response.success, response.message = success, "lit" if success else "no bulb"
            return response if answers else None

        self.nodes.append(self._make("lamp_server"))
        self.nodes[-1].serve(SetBool, "/lamp", switch)

    def switch(self, *reports: str) -> tuple[Any, ...]:
        """Switch the lamp on, wait for these reports, and return the last; a lamp that serves is found."""
        if len(self.nodes) > 1:
            spin_until(self.nodes, lambda: not self.client.missing(), what="the lamp")
        self.client.start("a1", "switch", {"on": True})
        spin_until(self.nodes, lambda: self.outlet.kinds("a1") == list(reports), what=str(reports))
        return self.outlet.reports[-1]


@pytest.fixture
def bench(make_node: MakeNode) -> Callable[..., Bench]:
    """Make the client of a lamp."""
    return partial(Bench, make_node)


def test_a_call_and_its_result(bench: Callable[..., Bench]) -> None:
    """The fields of the request, and those of the result."""
    one = bench()
    one.serve()
    assert one.switch("accepted", "done") == ("done", "a1", {"said": "lit"})
    assert one.asked == [True]


def test_a_server_that_comes_a_moment_later_is_waited_for(
    bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that was just made has not found its server yet; that is no error."""
    monkeypatch.setattr(bound_client, "DISCOVERY_S", PATIENCE)
    one = bench()
    one.client.start("a1", "switch", {"on": True})
    assert one.client.missing() == ["service /lamp"]
    spin_for(one.nodes, 0.2)
    assert one.outlet.reports == []
    one.serve()
    spin_until(one.nodes, lambda: one.outlet.kinds("a1") == ["accepted", "done"])


def test_a_server_that_never_comes_is_given_up_while_simulated_time_stands(
    bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The simulation may have died with the server; discovery needs real time."""
    monkeypatch.setattr(bound_client, "DISCOVERY_S", 0.2)
    one = bench(arguments=["--ros-args", "-p", "use_sim_time:=true"])
    one.client.start("a1", "switch", {"on": True})
    spin_until(
        one.nodes, lambda: one.outlet.reports[-1:] == [("failed", "a1", "lamp_gone", "/lamp: no server")]
    )


def test_what_waits_can_be_cancelled(bench: Callable[..., Bench]) -> None:
    """Then nothing is sent when the server comes."""
    one = bench()
    one.client.start("a1", "switch", {"on": True})
    one.client.cancel("a1")
    assert one.outlet.kinds("a1") == ["cancelled"]
    one.serve()
    spin_for(one.nodes, 0.5)
    assert one.asked == []


def test_a_server_that_says_no(bench: Callable[..., Bench]) -> None:
    """The one code, with the detail of the answer."""
    one = bench()
    one.serve(success=False)
    assert one.switch("accepted", "failed") == ("failed", "a1", "lamp_failed", "no bulb")


def test_a_server_that_says_nothing(bench: Callable[..., Bench]) -> None:
    """The deadline of the file counts."""
    one = bench(("SetBool}", "SetBool, deadline: 300 ms}"))
    one.serve(answers=False)
    assert one.switch("accepted", "failed") == (
        "failed",
        "a1",
        "lamp_failed",
        "/lamp: no answer within 0.3 s",
    )


def test_nobody_is_there(bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    """After the time that discovery takes, that is said at once."""
    monkeypatch.setattr("lupin_ros.orchestrator.binding_client.DISCOVERY_S", 0.0)
    one = bench()
    assert one.switch("accepted", "failed") == ("failed", "a1", "lamp_gone", "/lamp: no server")


def test_a_server_of_another_type_is_told(
    bench: Callable[..., Bench], make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody answers, and the reason is said with the attempt: the peers do not speak of the same."""
    monkeypatch.setattr("lupin_ros.orchestrator.binding_client.DISCOVERY_S", 0.0)
    one = bench()
    other = make_node("other_lamp")
    other.serve(Trigger, "/lamp", lambda _, response: response)
    both = "request", "answer"
    spin_until(one.nodes, lambda: len(peer_mismatches(one.nodes[0])) == len(both), what=f"its {both}")
    *_, code, detail = one.switch("accepted", "failed")
    assert code == "lamp_gone"
    assert detail.startswith(
        "/lamp: no server; answer of /lamp: node /other_lamp uses another definition: "
        "here std_srvs/srv/SetBool_Response RIHS01_"
    )
    assert "there std_srvs/srv/Trigger_Response RIHS01_" in detail


def test_what_cannot_be_sent(bench: Callable[..., Bench]) -> None:
    """A value that the field cannot hold is told with its place."""
    one = bench(("on: {type: bool", "on: {type: any"))
    one.serve()
    spin_until(one.nodes, lambda: not one.client.missing())
    one.client.start("a1", "switch", {"on": "yes"})
    problem = "std_srvs/srv/SetBool.Request.data: expected bool, got 'yes'; write true or false"
    assert one.outlet.reports == [("failed", "a1", "lamp_failed", f"bound.yaml:8:3: {problem}")]


def test_an_answer_that_nobody_foresaw(bench: Callable[..., Bench]) -> None:
    """An expression about the answer that fails is an error of the attempt."""
    one = bench(('from: "${ response.message }"', "from: \"${ ['lit'][len(response.message)] }\""))
    one.serve()
    reported = one.switch("accepted", "failed")
    assert reported[2:] == ("lamp_failed", "bound.yaml:8:3: list index out of range")


def test_operations_that_are_none(bench: Callable[..., Bench]) -> None:
    """Nobody else's are taken."""
    one = bench()
    with pytest.raises(ValueError, match="lamp has no operation 'burn'"):
        one.client.start("a1", "burn", {})
    with pytest.raises(ValueError, match="lamp has no action 'burn'"):
        one.client.act("burn", {})


def test_a_closed_client_lets_go(bench: Callable[..., Bench]) -> None:
    """Nothing follows, and its service is asked for no more."""
    one = bench()
    one.client.start("a1", "switch", {"on": True})
    one.client.close()
    one.serve()
    spin_for(one.nodes, 0.5)
    assert (one.asked, one.outlet.reports) == ([], [])


# -- definitions -------------------------------------------------------------------------------------------


def test_types_of_a_service_are_read_without_importing_it() -> None:
    """Names and kinds of fields, messages inside, whole numbers with their range."""
    trigger = interface_types("std_srvs/srv/Trigger")
    assert list(trigger) == ["request", "response", "constant"]
    assert (trigger["request"].fields, list(trigger["response"].fields)) == ({}, ["success", "message"])
    reading = interface_types("lupin_msgs/srv/GetTagReading")["response"]
    assert [(name, kind.kind) for name, kind in reading.fields.items()] == [
        ("status", "integer"),
        ("error_message", "text"),
        ("reading", "record"),
    ]
    assert (reading.fields["status"].minimum, reading.fields["status"].maximum) == (0, 255)
    sensors = reading.fields["reading"].fields["readings"]
    assert sensors.item is not None
    assert {name: kind.kind for name, kind in sensors.item.fields.items()} == {
        "name": "text",
        "value": "number",
    }


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        (
            "std_srv/srv/Trigger",
            "no package 'std_srv' with services is installed here; did you mean 'std_srvs'?",
        ),
        ("std_srvs/srv/Triger", "std_srvs has no service 'Triger'; did you mean 'Trigger'?"),
        (
            "qwxz/srv/Lamp",
            "no package 'qwxz' with services is installed here; "
            "add it by 'lupin interfaces add FOLDER', or source the workspace that has it",
        ),
    ],
)
def test_a_type_that_is_not_installed(name: str, problem: str) -> None:
    """What is meant, or what to do."""
    with pytest.raises(LookupError) as told:
        interface_types(name)
    assert told.value.args[0] == problem


def test_whether_a_package_is_there() -> None:
    """A checker passes over what it cannot see."""
    assert installed_types("qwxz/srv/Lamp") is None
    assert installed_types("std_srvs/srv/Trigger") == interface_types("std_srvs/srv/Trigger")
    assert interface_class("std_srvs/srv/Trigger") is Trigger


def test_messages_are_filled_and_read() -> None:
    """Lists of messages, messages in messages, whole numbers where digits are meant."""
    kind = interface_types("rcl_interfaces/srv/SetParameters")["request"]
    value = {"type": 3, "double_value": 2, "integer_array_value": [1]}
    data = {"parameters": [{"name": "speed", "value": value}]}
    message = fill(SetParameters.Request(), data, kind)
    assert message.parameters[0].value.double_value == 2.0
    (read,) = plain(message)["parameters"]
    assert (read["name"], read["value"]["type"], read["value"]["integer_array_value"]) == ("speed", 3, [1])
    with pytest.raises(ValueError, match=r"ParameterValue\.type: expected uint8 between 0 and 255, got 300"):
        fill(SetParameters.Request(), {"parameters": [{"value": {"type": 300}}]}, kind)


def test_an_array_has_its_length() -> None:
    """A covariance has 36 numbers."""
    pose = Type("record", "PoseWithCovariance", fields={"covariance": list_of(NUMBER)})
    assert fill(PoseWithCovariance(), {"covariance": [1.0] * 36}, pose).covariance[35] == 1.0
    with pytest.raises(ValueError, match=r"expected double\[36\], got 3 elements"):
        fill(PoseWithCovariance(), {"covariance": [1.0] * 3}, pose)


# -- parameters that come and go ---------------------------------------------------------------------------


def test_parameters_are_declared_anew(make_node: MakeNode) -> None:
    """New ones get what was given or their default, gone ones are gone, the others stay."""
    before = {"kept": Parameter(TEXT, "a", "stays"), "gone": Parameter(TEXT, "b", "goes")}
    given = ["--ros-args", "-p", "kept:=mine"]
    node = make_node("settings", given, before)
    after = {
        "kept": before["kept"],
        "pause": Parameter(DURATION, 5.0, "is new"),
        "rounds": Parameter(COUNT, 2, "is new", minimum=1),
    }
    node.declare_anew(after)
    assert node.parameters() == {"kept": "mine", "pause": 5.0, "rounds": 2}
    assert not node.node.has_parameter("gone")
    node.declare_anew({**after, "rounds": Parameter(COUNT, 3, "has another default", minimum=1)})
    assert node.parameters()["rounds"] == 3
    with pytest.raises(LupinError, match="parameter 'kept': expected count, got 'mine'"):
        node.declare_anew({"kept": Parameter(COUNT, 1, "is a number now")})
    assert node.parameters()["rounds"] == 3
