"""The live map of a ROS domain: who is at which end, and what does not arrive."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import pytest
from geometry_msgs.msg import Point
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from lupin_cli.main import main
from lupin_ros.adapter.network import UNKNOWN, Interface, interfaces
from lupin_ros.adapter.node import Qos, RosNode

MakeNode = Callable[..., RosNode]


def nothing(*_: object) -> None:
    """Take what comes."""


def seen_by(
    node: RosNode, others: list[RosNode], name: str, complete: Callable[[Interface], bool]
) -> Interface:
    """Return what is known of `name` once it is complete and every end has its node's name."""
    end = time.monotonic() + 20.0
    found: list[Interface] = []
    while not any(complete(i) and UNKNOWN not in (*i.producers, *i.consumers) for i in found):
        assert time.monotonic() < end, f"not within 20 s; last seen: {found}"
        for each in (node, *others):
            each.spin_once(0.02)
        found = [i for i in interfaces(node.node) if i.name == name]
    return found[0]


def two_ends(interface: Interface) -> bool:
    return bool(interface.producers and interface.consumers)


def test_a_topic_has_publishers_and_subscribers(make_node: MakeNode) -> None:
    """By full name, in the order of the alphabet, each once."""
    talker, listener, other = make_node("talker"), make_node("listener"), make_node("also")
    talker.publisher(Bool, "/news", Qos.EVENT)
    listener.subscribe(Bool, "/news", Qos.EVENT, nothing)
    listener.subscribe(Bool, "/news", Qos.EVENT, nothing)
    other.subscribe(Bool, "/news", Qos.EVENT, nothing)
    found = seen_by(talker, [listener, other], "/news", lambda i: len(i.consumers) == 2 and bool(i.producers))
    assert found == Interface("topic", "/news", "std_msgs/msg/Bool", ("/talker",), ("/also", "/listener"))
    assert not found.is_housekeeping


def test_a_service_has_servers_and_clients(make_node: MakeNode) -> None:
    """One interface, not the two DDS topics behind it."""
    server, client = make_node("server"), make_node("client")
    server.serve(Trigger, "/room/open", lambda _, answer: answer)
    client.service(Trigger, "/room/open")
    found = seen_by(client, [server], "/room/open", two_ends)
    assert found == Interface("service", "/room/open", "std_srvs/srv/Trigger", ("/server",), ("/client",))
    assert [i.name for i in interfaces(client.node) if "room" in i.name] == ["/room/open"]


def test_an_action_is_one_interface(make_node: MakeNode) -> None:
    """Not the three services and two topics that it is made of."""
    server, client = make_node("base"), make_node("pilot")
    server.serve_action(NavigateToPose, "/drive", admit=lambda _: True, started=nothing, cancelled=nothing)
    client.action(NavigateToPose, "/drive")
    found = seen_by(client, [server], "/drive", two_ends)
    assert found == Interface("action", "/drive", "nav2_msgs/action/NavigateToPose", ("/base",), ("/pilot",))
    assert [i.name for i in interfaces(client.node) if "/drive" in i.name] == ["/drive"]


def test_a_client_without_a_server_is_seen(make_node: MakeNode) -> None:
    """That nobody serves it is no problem yet: it may be a service that is optional."""
    client = make_node("client")
    client.service(Trigger, "/nobody/there")
    found = seen_by(client, [], "/nobody/there", lambda i: bool(i.consumers))
    assert (found.producers, found.consumers, found.problems) == ((), ("/client",), ())


def test_a_reader_that_asks_for_more_than_is_offered_is_told(make_node: MakeNode) -> None:
    """Neither side says a word when nothing arrives."""
    talker, late = make_node("talker"), make_node("late")
    talker.publisher(Bool, "/news", Qos.SENSOR)
    late.subscribe(Bool, "/news", Qos.LATCHED, nothing)
    found = seen_by(late, [talker], "/news", two_ends)
    assert found.problems == (
        "/late hears nothing of /talker: best effort publisher and reliable subscription, "
        "volatile publisher and transient local subscription",
    )


def test_two_servers_of_one_service_are_told(make_node: MakeNode) -> None:
    """Both would carry out every request."""
    servers = [make_node("one"), make_node("two")]
    for server in servers:
        server.serve(Trigger, "/arm/home", lambda _, answer: answer)
    found = seen_by(servers[0], servers[1:], "/arm/home", lambda i: len(i.producers) == 2)
    assert found.problems == ("2 servers (/one, /two): every request is carried out by each",)


def test_two_definitions_of_one_name_are_told(make_node: MakeNode) -> None:
    """For topics and services alike."""
    ours, theirs = make_node("ours"), make_node("theirs")
    ours.publisher(String, "/place", Qos.EVENT)
    theirs.subscribe(Point, "/place", Qos.EVENT, nothing)
    ours.serve(Trigger, "/light", lambda _, answer: answer)
    theirs.service(SetBool, "/light")
    (problem,) = seen_by(ours, [theirs], "/place", two_ends).problems
    assert problem.startswith("different definitions (/ours: std_msgs/msg/String RIHS01_")
    assert "; /theirs: geometry_msgs/msg/Point RIHS01_" in problem
    assert problem.endswith("): build both sides from the same interface packages")
    assert len(seen_by(ours, [theirs], "/light", two_ends).problems) == 1


def test_who_looks_can_be_left_out(make_node: MakeNode) -> None:
    """What only they have is not there, then."""
    looking, other = make_node("looking"), make_node("other")
    looking.publisher(Bool, "/mine", Qos.EVENT)
    other.publisher(Bool, "/theirs", Qos.EVENT)
    seen_by(looking, [other], "/theirs", lambda i: bool(i.producers))
    names = {i.name for i in interfaces(looking.node, without=["/looking"])}
    assert "/theirs" in names
    assert "/mine" not in names


def test_what_every_node_has_is_housekeeping(make_node: MakeNode) -> None:
    """Logs, parameters, type descriptions."""
    node = make_node("plain")
    seen_by(node, [], "/plain/get_parameters", lambda i: bool(i.producers))
    assert [i for i in interfaces(node.node) if not i.is_housekeeping] == []


def test_lupin_graph_shows_it_and_its_exit_code_tells_of_problems(
    make_node: MakeNode, ros_domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a table, as JSON and as a flowchart; words choose."""
    talker, late = make_node("talker"), make_node("late")
    talker.publisher(Bool, "/news", Qos.EVENT)
    late.subscribe(Bool, "/news", Qos.EVENT, nothing)
    talker.serve(Trigger, "/room/open", lambda _, answer: answer)

    assert main(["graph", "--domain", str(ros_domain), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [
        {
            "kind": "topic",
            "name": "/news",
            "type": "std_msgs/msg/Bool",
            "producers": ["/talker"],
            "consumers": ["/late"],
            "problems": [],
        },
        {
            "kind": "service",
            "name": "/room/open",
            "type": "std_srvs/srv/Trigger",
            "producers": ["/talker"],
            "consumers": [],
            "problems": [],
        },
    ]
    assert main(["graph", "--mermaid", "news"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "flowchart LR",
        '  n0["late"]',
        '  n1["talker"]',
        '  i0(["/news"])',
        "  n1 --> i0",
        "  i0 --> n0",
    ]
    late.subscribe(Bool, "/news", Qos.LATCHED, nothing)
    assert main(["graph"]) == 1
    told = capsys.readouterr().out
    assert [line.split() for line in told.splitlines() if "/room/open" in line] == [
        ["/room/open", "talker", "nobody"]
    ]
    assert (
        "/news: /late hears nothing of /talker: volatile publisher and transient local subscription" in told
    )
    assert main(["graph", "nws"]) == 2
    assert capsys.readouterr().err == (
        "lupin: nothing here has 'nws' in its name, type or nodes; did you mean '/news'?\n"
    )
    assert main(["graph", "greenhouse"]) == 2
    assert capsys.readouterr().err == "lupin: nothing here has 'greenhouse' in its name, type or nodes\n"
    assert main(["graph", "--json", "--mermaid"]) == 2
    assert capsys.readouterr().err == (
        "lupin: --mermaid and --json are two forms of the same map: give one of them\n"
    )


def test_a_node_that_has_nothing_of_its_own_is_no_map(
    make_node: MakeNode, ros_domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """What every node has is shown when it is asked for."""
    make_node("plain")
    assert main(["graph"]) == 2
    told = "lupin: nobody here has more than what every node has; --all shows that\n"
    assert capsys.readouterr().err == told
    assert main(["graph", "--all", "--json"]) == 0
    assert "/plain/get_parameters" in {i["name"] for i in json.loads(capsys.readouterr().out)}


def test_an_empty_domain_is_said_to_be_empty(ros_domain: int, capsys: pytest.CaptureFixture[str]) -> None:
    """With what to do."""
    assert main(["graph"]) == 2
    assert capsys.readouterr().err == (
        f"lupin: there is no other node in ROS domain {ros_domain}; give --domain, or `lupin up`\n"
    )
