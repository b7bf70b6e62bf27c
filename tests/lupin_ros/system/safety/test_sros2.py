"""`lupin security policy`: a policy that sros2 can read, and that a mission needs no more than.

What the public schemas say (policy.xsd of sros2 0.2.0, the governance of OMG DDS-Security) is asserted here
in words of our own; sros2 itself is on no package index. An apt ROS 2 brings it, and its schema is asked too.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest

from lupin_engine.plugin.pages import declared_access
from lupin_engine.plugin.registry import load_catalog
from lupin_harness.domains import claimed_domain
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.network import interfaces
from lupin_ros.launch.operator import Operator as Verbs
from lupin_ros.service.names import ACCESS
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import Operator, World
from tests.plugins.gateway.served import OpenPage

pytestmark = pytest.mark.timeout(180)

ROOT = Path(__file__).parents[4]
#: Kind -> what its ends may do: who produces, who consumes.
MAY = {"topic": ("publish", "subscribe"), "service": ("reply", "request"), "action": ("execute", "call")}
Permission = tuple[str, str, str]
#: Nodes of people's verbs, which have one enclave.
_PERSON = re.compile(r"^/lupin_(operator|graph|recorder)_\d+$")


def written(folder: Path, *arguments: str) -> Path:
    """Call the verb as people do, and return the folder of what it wrote."""
    command = [str(Path(sys.executable).with_name("lupin")), "security", "policy", *arguments]
    subprocess.run([*command, "--into", str(folder)], check=True, capture_output=True, cwd=ROOT, timeout=120)
    return folder


def permissions(file: Path) -> dict[str, set[Permission]]:
    """Return what each node may, and assert on the way that the file has the form of the schema."""
    root = Xml.parse(file).getroot()
    assert (root.tag, root.attrib, [e.tag for e in root]) == ("policy", {"version": "0.2.0"}, ["enclaves"])
    found = {}
    for enclave in root[0]:
        assert (enclave.tag, set(enclave.attrib), [e.tag for e in enclave]) == (
            *("enclave", {"path"}),
            ["profiles"],
        )
        for profile in enclave[0]:
            assert (profile.tag, set(profile.attrib)) == ("profile", {"ns", "node"})
            node = profile.get("ns", "").rstrip("/") + "/" + profile.get("node", "")
            assert enclave.get("path") == ("/lupin/operator" if "operator" in node else f"/lupin{node}")
            found[node] = set(_allowed(profile))
    return found


def _allowed(profile: Xml.Element) -> Iterator[Permission]:
    for group in profile:
        kind = group.tag.removesuffix("s")
        assert kind in MAY
        ((may, word),) = group.attrib.items()
        assert may in MAY[kind]
        assert word == "ALLOW"
        assert len(group) > 0
        for one in group:
            assert (one.tag, one.attrib, len(one)) == (kind, {}, 0)
            assert (one.text or "").startswith("/")
            yield kind, may, one.text or ""


def _whole(kind: str, may: str, name: str) -> Permission:
    """Return what permits a part of an action, for its server and who sends goals: the action."""
    action, part, _ = name.partition("/_action/")
    if not part:
        return kind, may, name
    return "action", "execute" if may in ("reply", "publish") else "call", action


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files for the inspection and the exploration, with the simulated robot."""
    return written(tmp_path_factory.mktemp("policy"), "inspection", "exploration", "--sim")


def reasons(file: Path) -> dict[str, set[Permission]]:
    """Return what each node may for a reason that a comment tells: it does not always use it."""
    builder = Xml.TreeBuilder(insert_comments=True)
    found: dict[str, set[Permission]] = {}
    for profile in Xml.parse(file, Xml.XMLParser(target=builder)).getroot().iter("profile"):
        own = found.setdefault(f"/{profile.get('node')}", set())
        for group in profile:
            told = ""
            for one in group:
                told = one.text or "" if one.tag is Xml.Comment else told
                if told and one.tag is not Xml.Comment:
                    own.add((group.tag.removesuffix("s"), next(iter(group.attrib)), one.text or ""))
    return found


def _of_page(port: int) -> None:
    """Use all that pages may use, as an engineer: publish, call, send goals, hear, read a parameter."""
    page = OpenPage(port)
    there = {kind: set(page.call(f"/rosapi/{kind}s")["values"][f"{kind}s"]) for kind in ("service", "topic")}
    actions = set(page.call("/rosapi/action_servers")["values"]["action_servers"])
    declared = [*declared_access(load_catalog()), ACCESS]
    names = {name for one in declared for name in (*one.operator, *one.engineer) if "*" not in name}
    for name in sorted(names):
        frame: dict[str, Any] = {"op": "advertise", "topic": name, "type": "std_msgs/msg/String"}
        if name in actions:
            frame = {"op": "send_action_goal", "action": name, "id": name, "args": {}}
        elif name in there["service"] or "/_action/" in name:
            frame = {"op": "call_service", "service": name, "id": name, "args": {}}
        elif name in there["topic"]:
            frame["type"] = page.call("/rosapi/topic_type", topic=name)["values"]["type"]
        page.send(frame)
    page.call("/rosapi/get_param", name="/lupin_twin:frame_id")
    page.send({"op": "subscribe", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan"})
    page.work_off()
    assert {"/cmd_vel", "/goal_pose"} <= names - there["service"] - actions


@pytest.fixture(scope="module")
def seen_in_a_run(
    tmp_path_factory: pytest.TempPathFactory,
) -> set[tuple[str, Permission]]:
    """What nodes of a real run have on the network, with a page, and verbs of people beside it."""
    folder = tmp_path_factory.mktemp("run")
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder))
        patch.setenv("ROS_DOMAIN_ID", str(stack.enter_context(claimed_domain())))
        world = World(folder)
        stack.callback(world.stop)
        port = free_port()
        for node in ("perception_aggregator", "lupin_twin", "lupin_arm", "lupin_arm_sim", "nav_watchdog"):
            world.start(node)
        world.start_all()
        world.start("lupin_gateway", port=port)
        recording = [str(Path(sys.executable).with_name("lupin")), "record", str(folder / "run.mcap")]
        world.run("recorder", recording)
        operator = Operator()
        stack.callback(operator.ros.close)
        verbs = Verbs(load_catalog().profile)
        stack.callback(verbs.close)
        ends: set[tuple[str, Permission]] = set()

        def look() -> bool:
            """Keep what is there now: some listen for a while only. Say whether the page's part is there."""
            for one in interfaces(operator.ros.node, parts=True):
                for nodes, may in zip((one.producers, one.consumers), MAY[one.kind], strict=True):
                    ends.update((_PERSON.sub("/lupin_operator", n), (one.kind, may, one.name)) for n in nodes)
            return {("topic", "publish", "/cmd_vel"), ("action", "call", "/navigate_to_pose")} <= {
                may for node, may in ends if node == "/lupin_gateway"
            }

        operator.in_state("READY")
        # Before the mission, which would have the base for itself.
        _of_page(port)
        operator.until(look, "the page's publishers and clients")
        request = StartMission.Request(mission_type="ExplorationMission", discovery_goal=1)
        assert operator.call(StartMission, "/mission/start", request).accepted
        explores = ("/mission_orchestrator", ("topic", "subscribe", "/map"))
        operator.until(lambda: look() or explores in ends, "the map, which it hears while it explores")
    return ends


@pytest.mark.long
def test_all_that_a_run_does_is_permitted(
    simulated: Path, seen_in_a_run: set[tuple[str, Permission]]
) -> None:
    """Everything on the network, of every node that has an enclave."""
    allowed = permissions(simulated / "policy.xml")
    seen = {(node, may) for node, may in seen_in_a_run if node in allowed}
    assert {node for node, _ in seen} == allowed.keys()
    assert len(seen) > 200
    assert {(node, may) for node, may in seen if not _is_in(may, allowed[node])} == set()


def test_what_is_permitted_is_used_or_says_why_not(
    simulated: Path, seen_in_a_run: set[tuple[str, Permission]]
) -> None:
    """The other direction: of what no node has in that run each has its reason in the file."""
    allowed, why = permissions(simulated / "policy.xml"), reasons(simulated / "policy.xml")
    used = {
        node: {one for who, may in seen_in_a_run if who == node for one in (may, _whole(*may))}
        for node in allowed
    }
    assert {
        (node, may) for node, granted in allowed.items() for may in granted - used[node] - why[node]
    } == set()


def _is_in(may: Permission, granted: set[Permission]) -> bool:
    """Say whether something is permitted, by its name or a pattern, or as a part of an action."""
    return any(
        one[:2] == wanted[:2] and fnmatchcase(wanted[2], one[2])
        for one in granted
        for wanted in (may, _whole(*may))
    )


def test_nobody_sets_the_parameters_of_others(simulated: Path) -> None:
    """Each node has them, and no node or person calls that."""
    for granted in permissions(simulated / "policy.xml").values():
        asked = [name for _, may, name in granted if may == "request"]
        for service in ("set_parameters", "set_parameters_atomically"):
            assert not [
                name for name in asked if fnmatchcase(f"/lupin_sim/{service}", name) or service in name
            ]


def test_a_node_may_no_more_than_it_declares(simulated: Path) -> None:
    """The simulated robot cannot start a mission, the twin not drive."""
    allowed = permissions(simulated / "policy.xml")
    assert ("action", "call", "/navigate_to_pose") in allowed["/mission_orchestrator"]
    assert ("topic", "subscribe", "/map") in allowed["/mission_orchestrator"]
    callers = {node for node, may in allowed.items() if ("service", "request", "/mission/start") in may}
    assert callers == {"/lupin_gateway", "/lupin_operator"}
    drivers = {node for node, may in allowed.items() if ("action", "call", "/navigate_to_pose") in may}
    assert drivers == {"/mission_orchestrator", "/lupin_gateway", "/lupin_sim"}  # a click on the map
    assert ("topic", "publish", "/mission/state") not in allowed["/lupin_gateway"]


def test_bindings_are_permitted(tmp_path: Path) -> None:
    """What a binding calls and hears, of the orchestrator alone; and no simulated robot is spoken of."""
    example = ROOT / "examples" / "photo_round" / "missions"
    (mission,) = (file for file in example.glob("*.yaml") if file.name != "lifecycle.yaml")
    allowed = permissions(written(tmp_path, str(mission)) / "policy.xml")
    assert "/lupin_sim" not in allowed
    assert ("service", "request", "/navigate_to_pose/_action/cancel_goal") in allowed["/nav_watchdog"]
    for permission in (
        ("service", "request", "/camera/photo"),
        ("topic", "publish", "/camera/lamp"),
        ("topic", "subscribe", "/camera/light"),
    ):
        owners = {node for node, may in allowed.items() if permission in may}
        assert owners - {"/lupin_gateway"} == {"/mission_orchestrator"}


def test_the_governance_lets_nobody_in_without_permissions(simulated: Path) -> None:
    """In the order that the schema asks for."""
    root = Xml.parse(simulated / "governance.xml").getroot()
    (rule,) = root.findall("domain_access_rules/domain_rule")
    assert (root.tag, rule[0].tag, rule[0][0].tag) == ("dds", "domains", "id")
    assert (rule[0][0].text or "").isdecimal()
    assert {e.tag: e.text for e in rule[1:-1]} == {
        "allow_unauthenticated_participants": "false",
        "enable_join_access_control": "true",
        "discovery_protection_kind": "ENCRYPT",
        "liveliness_protection_kind": "ENCRYPT",
        "rtps_protection_kind": "SIGN",
    }
    (topics,) = rule[-1]
    assert (rule[-1].tag, topics.tag) == ("topic_access_rules", "topic_rule")
    assert [(e.tag, e.text) for e in topics] == [
        ("topic_expression", "*"),
        ("enable_discovery_protection", "true"),
        ("enable_liveliness_protection", "true"),
        ("enable_read_access_control", "true"),
        ("enable_write_access_control", "true"),
        ("metadata_protection_kind", "ENCRYPT"),
        ("data_protection_kind", "ENCRYPT"),
    ]


@pytest.mark.skipif(importlib.util.find_spec("sros2") is None, reason="sros2 comes with an apt ROS 2 only")
def test_sros2_reads_it(simulated: Path) -> None:
    """By its own schema."""
    from sros2.policy import load_policy

    assert load_policy(simulated / "policy.xml").getroot().tag == "policy"


@pytest.mark.core
def test_a_node_runs_in_its_own_enclave(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where SROS2 is switched on: with keys of another robot, or none, it does not start."""
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path))
    process = world.start("greenhouse_bridge")
    assert process.wait(60.0) == 2
    told = world.log("greenhouse_bridge").read_text(encoding="utf-8")
    enclave = tmp_path / "enclaves" / "lupin" / "greenhouse_bridge"
    assert told.endswith(f"SECURITY ERROR: directory '{enclave}' does not exist.\n")
