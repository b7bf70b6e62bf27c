"""The page of the interfaces: what nodes declare, recorded from their start, and the interface files.

    .venv/bin/python tools/interfaces.py > docs/interfaces.md

Every node of the shipped plugins is started as `lupin node` does it, in a ROS domain of its own, with its
defaults and without spinning: what it publishes, subscribes, serves and calls is written down as it says it.
Rates are the constants and parameters by which the nodes go.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

from lupin_arm.node import library as arm_library
from lupin_arm.node import sim as arm_sim
from lupin_engine.plugin.registry import load_catalog
from lupin_gateway import stop
from lupin_greenhouse import stops
from lupin_harness.domains import claimed_domain
from lupin_perception.node import layout
from lupin_perception.node import settings as perception
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.qos import Qos
from lupin_ros.launch.nodes import nodes_of
from lupin_ros.orchestrator import OWN_PARAMETERS
from lupin_ros.orchestrator import node as orchestrator
from lupin_sim.node import robot, senses
from lupin_twin import node as twin

ROOT = Path(__file__).resolve().parents[1]
FILES = ROOT / "lupin_msgs"
#: The packages whose types stand on the page.
PACKAGES = {"lupin_msgs": FILES, "lupin_engine_msgs": ROOT / "interfaces" / "lupin_engine_msgs"}
#: Requests to cancel goals are part of the action.
_ACTION = "/_action/"

HEAD = """\
# Interfaces

Every topic, service and action of the nodes that come with Lupin, as the nodes declare them at their start
with their defaults, and the types of `lupin_msgs` and `lupin_engine_msgs`. "outside" is whoever else is on
the network: the operator's HMI, the robot's own drivers, Nav2. What a binding or another plugin adds is not
here: what is on the network now, `lupin graph` tells. The gateway also hears what pages want, and whatever
its parameter `history` names. Each node also tells how it is, once a second on `/diagnostics`
(diagnostic_msgs/DiagnosticArray, by REP 107): its process, its machine, the rates of its topics, and below
`NODE: SUBJECT` each trouble with its `code`, `cause` and `advice`. All but the simulated ones also answer
the services of [a lifecycle manager](operating.md#lifecycle-managers). `lupin types` writes all types for
TypeScript, or as JSON Schema. With [a robot's name](operating.md#several-robots) all names are in its
namespace.

## Quality of service

| Name | Reliability | Durability | Depth |
|---|---|---|---|"""


@dataclass
class Declared:
    """A topic, service or action: its type, the profiles by which it is used, and the nodes at its ends."""

    kind: str
    name: str
    type: str
    producers: set[str] = field(default_factory=set)
    consumers: set[str] = field(default_factory=set)
    sent: set[Qos] = field(default_factory=set)
    read: set[Qos] = field(default_factory=set)


def rates() -> Mapping[str, str]:
    """Return how often topics are told; the others when something happens."""
    state = OWN_PARAMETERS["state_publish_rate_hz"].default
    battery = robot.HEARTBEAT_S * robot.BEATS_PER_BATTERY
    frames = f"{1 / robot.HEARTBEAT_S:g} Hz, and every {robot.LOOK_M:g} m while it drives"
    return {
        "/mission/state": f"{state:g} Hz, and on change",
        "/twin/state": f"{twin.PARAMETERS['state_publish_rate_hz'].default:g} Hz",
        "/perception/discovered_tags": f"{perception.PARAMETERS['publish_rate_hz'].default:g} Hz",
        "/perception/box_geometry_json": f"{1 / layout.PUBLISH_S:g} Hz",
        "/e_stop_state": f"{1 / robot.HEARTBEAT_S:g} Hz",
        "/io/power/power_watcher": f"{1 / battery:g} Hz",
        "/amcl_pose": f"{1 / robot.POSE_PERIOD_S:g} Hz",
        "/map": f"on change, and every {senses.REPUBLISH_S:g} s",
        "/tf": f"{1 / robot.HEARTBEAT_S:g} Hz, and every frame while it drives",
        "/camera/tag_detections_json": frames,
        "/yolo/detections": frames,
        "/plan": f"every {robot.MOVE_S * robot.MOVES_PER_PLAN:g} s while it drives",
        stops.PAGES_TOPIC: f"{stop.PUBLISH_HZ:g} Hz, and on change",
        stops.HMI_TOPIC: f"{stop.PUBLISH_HZ:g} Hz while engaged, and on change",
        "/lupin/arm/library/state": f"{1 / arm_library.PUBLISH_EVERY_S:g} Hz",
        "/joint_states": f"{1 / arm_sim.REST_S:g} Hz, {1 / arm_sim.MOVE_S:g} Hz while it moves",
    }


def declared() -> list[Declared]:
    """Return what all nodes declare, by kind and name."""
    found: dict[tuple[str, str], Declared] = {}

    def note(ros: RosNode, kind: str, name: str, type_: Any, *, serves: bool, qos: Qos | None = None) -> None:
        if _ACTION in name:
            return
        one = found.setdefault((kind, name), Declared(kind, name, _type_name(type_)))
        (one.producers if serves else one.consumers).add(ros.name)
        if qos is not None:
            (one.sent if serves else one.read).add(qos)

    with _recording(note), tempfile.TemporaryDirectory() as state, claimed_domain() as domain:
        own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with patch.dict(os.environ, {**own, "XDG_STATE_HOME": state, "XDG_CONFIG_HOME": state}):
            for node in nodes_of(load_catalog()).values():
                node.run([])
    order = ("topic", "service", "action")
    return sorted(found.values(), key=lambda one: (order.index(one.kind), one.name))


@contextlib.contextmanager
def _recording(note: Callable[..., None]) -> Iterator[None]:
    """Let `note` hear of all that nodes declare, and let none of them spin."""
    publisher, subscribe, serve = RosNode.publisher, RosNode.subscribe, RosNode._serve
    service, action, serve_action = RosNode.service, RosNode.action, RosNode.serve_action

    def on_topic(of: Any, serves: bool) -> Any:
        def declare(ros: RosNode, kind: Any, topic: str, qos: Qos, *more: Any) -> Any:
            note(ros, "topic", ros.node.resolve_topic_name(topic), kind, serves=serves, qos=qos)
            return of(ros, kind, topic, qos, *more)

        return declare

    def on_request(of: Any, what: str, serves: bool) -> Any:
        def declare(ros: RosNode, kind: Any, name: str, *more: Any, **named: Any) -> Any:
            note(ros, what, ros.node.resolve_service_name(name), kind, serves=serves)
            return of(ros, kind, name, *more, **named)

        return declare

    with contextlib.ExitStack() as stack:
        for owner, name, replaced in (
            (RosNode, "publisher", on_topic(publisher, True)),
            (RosNode, "subscribe", on_topic(subscribe, False)),
            (RosNode, "_serve", on_request(serve, "service", True)),
            (RosNode, "service", on_request(service, "service", False)),
            (RosNode, "action", on_request(action, "action", False)),
            (RosNode, "serve_action", on_request(serve_action, "action", True)),
            (RosNode, "rehearsed", lambda _: None),
            # It hears the state of another orchestrator, should there be one, at its start only.
            (orchestrator, "other_orchestrator", lambda *_: ""),
        ):
            stack.enter_context(patch.object(owner, name, replaced))
        yield


def _type_name(kind: Any) -> str:
    package, where, *_ = kind.__module__.split(".")
    return f"{package}/{where}/{kind.__name__}"


# -- the page ---------------------------------------------------------------------------------------------


def page() -> str:
    """Return the page."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield HEAD
    for qos in Qos:
        profile = qos.profile()
        yield _row(qos.value, _word(profile.reliability), _word(profile.durability), str(profile.depth))
    yield from ("", "Services and actions of these nodes have the profile *services*.")
    found, told = declared(), rates()
    yield from _heading("Topics", "Topic", "Type", "QoS", "Depth", "Rate", "Producers", "Consumers")
    for one in (one for one in found if one.kind == "topic"):
        rate = told.get(one.name, "when there is news")
        yield _row(f"`{one.name}`", _linked(one.type), *_qos(one), rate, *_ends(one))
    for kind in ("service", "action"):
        yield from _heading(f"{kind.capitalize()}s", "Name", "Type", "Server", "Clients")
        for one in (one for one in found if one.kind == kind):
            yield _row(f"`{one.name}`", _linked(one.type), *_ends(one))
    yield from _types()


def _heading(title: str, *columns: str) -> Iterator[str]:
    yield from ("", f"## {title}", "", _row(*columns), "|" + "---|" * len(columns))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _word(policy: Any) -> str:
    return str(policy.name).lower().replace("_", " ")


def _qos(one: Declared) -> tuple[str, str]:
    """Return the profile of a topic and its depth; where both ends are ours and differ, both."""
    sent, read = (sorted(ends, key=lambda qos: qos.value) for ends in (one.sent, one.read))
    names, depths = (
        [", ".join(tell(qos) for qos in ends) for ends in (sent, read) if ends]
        for tell in (lambda qos: qos.value, lambda qos: str(qos.profile().depth))
    )
    return "; read as ".join(dict.fromkeys(names)), "; ".join(dict.fromkeys(depths))


def _ends(one: Declared) -> Iterator[str]:
    for nodes in (one.producers, one.consumers):
        yield ", ".join(sorted(nodes)) or "outside"


def _linked(type_: str) -> str:
    """Return a type's name, which leads to its file on this page where it is one of ours."""
    package, _, name = type_.split("/")
    return f"[{name}](#{name.lower()})" if package in PACKAGES else f"{package}/{name}"


def _types() -> Iterator[str]:
    yield from (
        "",
        "## Types",
        "",
        "As the files of the packages have them; a type that is made of others names them.",
    )
    for kind in ("msg", "srv", "action"):
        files = [file for package in PACKAGES.values() for file in package.glob(f"{kind}/*.{kind}")]
        for file in sorted(files, key=lambda file: file.stem):
            text = file.read_text(encoding="utf-8").strip()
            yield from ("", f"### {file.stem}", "")
            inner = _nesting(file.stem)
            if inner:
                yield from (f"Made of {', '.join(inner)}.", "")
            yield from ("```text", text, "```")


def _nesting(name: str) -> list[str]:
    """Return the types of these packages that a type is made of, each with what that is made of."""
    found = []
    for inner in dict.fromkeys(_inner(name)):
        below = _nesting(inner)
        found.append(f"[{inner}](#{inner.lower()})" + (f" (of {', '.join(below)})" if below else ""))
    return found


def _inner(name: str) -> Iterator[str]:
    known = {file.stem for package in PACKAGES.values() for file in package.glob("msg/*.msg")}
    (file,) = (file for package in PACKAGES.values() for file in package.glob(f"*/{name}.*"))
    for line in file.read_text(encoding="utf-8").splitlines():
        declared_type = line.partition("#")[0].split()[:1]
        for one in declared_type:
            if (bare := one.partition("[")[0]) in known:
                yield bare


if __name__ == "__main__":
    sys.stdout.write(page())
