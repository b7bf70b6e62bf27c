"""`lupin security policy`: a policy that sros2 can read, and that a mission needs no more than.

What the public schemas say (policy.xsd of sros2 0.2.0, the governance of OMG DDS-Security) is asserted here
in words of our own; sros2 itself is on no package index. An apt ROS 2 brings it, and its schema is asked too.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest

from lupin_engine.ros.adapter.network import interfaces
from tests.ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

ROOT = Path(__file__).parents[3]
#: Kind -> what its ends may do: who produces, who consumes.
MAY = {"topic": ("publish", "subscribe"), "service": ("reply", "request"), "action": ("execute", "call")}
Permission = tuple[str, str, str]


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


def test_all_that_a_mission_does_is_permitted(simulated: Path, world: World, operator: Operator) -> None:
    """Everything on the network of a real run, of every node that has an enclave."""
    allowed = permissions(simulated / "policy.xml")
    world.start("perception_aggregator")
    world.start("lupin_twin")
    world.start_all()
    operator.in_state("READY")
    assert operator.start("1").accepted
    operator.until_done(published=1)
    seen: set[tuple[str, Permission]] = set()
    for one in interfaces(operator.ros.node, parts=True):
        for ends, may in zip((one.producers, one.consumers), MAY[one.kind], strict=True):
            seen |= {(node, (one.kind, may, one.name)) for node in ends if node in allowed}
    assert {node for node, _ in seen} >= {"/mission_orchestrator", "/lupin_sim", "/lupin_twin"}
    assert len(seen) > 100
    assert {(node, may) for node, may in seen if not {may, _whole(*may)} & allowed[node]} == set()


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
