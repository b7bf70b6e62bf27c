"""Writes the permissions of SROS2: who may publish, subscribe, serve and call which name.

Every node is an enclave of its own, `/lupin/NODE`; the verbs of people share one, `/lupin/operator`.
The form is that of policy.xsd of sros2 (0.2.0), and of the governance of OMG DDS-Security 1.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from types import MappingProxyType
from xml.etree import ElementTree as Xml

from lupin_engine.plugin import Access, name_of
from lupin_ros.adapter.network import ACTION, Interface
from lupin_ros.adapter.node import OPERATOR_ENCLAVE, enclave_of
from lupin_ros.service.names import DIAGNOSTICS_TOPIC

#: Kind, what may be done, and the absolute name.
Permission = tuple[str, str, str]
#: Permissions, each with why a node has it that does not always use it.
_Granted = dict[Permission, str]

_VERSION = "0.2.0"
#: Kind -> what an end that produces may do, and one that consumes, in the words of sros2.
_MAY: Mapping[str, tuple[str, str]] = MappingProxyType(
    {"topic": ("publish", "subscribe"), "service": ("reply", "request"), "action": ("execute", "call")}
)
#: What every node may, besides what it declares.
_EVERY: Mapping[Permission, str] = MappingProxyType(
    {
        ("topic", "subscribe", "/clock"): "where use_sim_time is set",
        ("topic", "publish", DIAGNOSTICS_TOPIC): "",
    }
)
#: What a node that serves pages may, whatever pages use.
_EVERY_PAGE: Mapping[Permission, str] = MappingProxyType(
    {
        ("topic", "subscribe", "/*"): "an engineer's page may read every topic",
        ("service", "request", "/*/get_parameters"): "an operator's page may read parameters",
    }
)
_BY_PAGES = "where a page uses it"
_OF_OTHERS = "where a page uses it; no node here has it, so it may be a topic, a service or an action"
#: The nodes of people's verbs, with the numbers of their processes.
_VERBS = ("/lupin_operator_*", "/lupin_graph_*", "/lupin_recorder_*")
_BY_VERBS = "where a person's verb uses it"
#: What the governance asks of everybody: a certificate of ours, permissions, and that nothing can be read.
_DOMAIN_RULE = (
    ("allow_unauthenticated_participants", "false"),
    ("enable_join_access_control", "true"),
    ("discovery_protection_kind", "ENCRYPT"),
    ("liveliness_protection_kind", "ENCRYPT"),
    ("rtps_protection_kind", "SIGN"),
)
_TOPIC_RULE = (
    ("topic_expression", "*"),
    ("enable_discovery_protection", "true"),
    ("enable_liveliness_protection", "true"),
    ("enable_read_access_control", "true"),
    ("enable_write_access_control", "true"),
    ("metadata_protection_kind", "ENCRYPT"),
    ("data_protection_kind", "ENCRYPT"),
)


def policy(
    declared: Iterable[Interface],
    nodes: Iterable[str],
    pages: Mapping[str, Access],
    asked: Iterable[str],
    robot: str = "",
) -> str:
    """Return the policy.xml of nodes, with comments about permissions that are not always used.

    Args:
        declared: the interfaces of these nodes, and of others, from which the kinds of names follow.
        nodes: their full names.
        pages: the additional permissions of nodes that serve pages.
        asked: the services that the verbs of people call.
        robot: the namespace of all of them.
    """
    known = list(declared)
    every = {(kind, may, name_of(robot, name)): why for (kind, may, name), why in _EVERY.items()}
    allowed: dict[str, _Granted] = {node: {**every} for node in nodes}
    for one in known:
        for ends, may in zip((one.producers, one.consumers), _MAY[one.kind], strict=True):
            for node in allowed.keys() & ends:
                allowed[node][one.kind, may, one.name] = ""
    for node in allowed.keys() & pages.keys():
        allowed[node] = {**_of_pages(pages[node], known), **_EVERY_PAGE, **_without_reading(allowed[node])}
    people = f"{robot}/lupin_operator"
    allowed[people] = _of_operators(known, asked, robot)
    root = Xml.Element("policy", version=_VERSION)
    enclaves = Xml.SubElement(root, "enclaves")
    for node in sorted(allowed):
        namespace, _, name = node.rpartition("/")
        path = OPERATOR_ENCLAVE if node == people else enclave_of(name)
        profiles = Xml.SubElement(Xml.SubElement(enclaves, "enclave", path=path), "profiles")
        profile = Xml.SubElement(profiles, "profile", ns=namespace or "/", node=name)
        _fill(profile, _without_parts(allowed[node]))
    return _text(root)


def governance(domain: int) -> str:
    """Return the governance.xml of a ROS domain: no node without permissions, nothing in clear."""
    root = Xml.Element("dds")
    rule = Xml.SubElement(Xml.SubElement(root, "domain_access_rules"), "domain_rule")
    Xml.SubElement(Xml.SubElement(rule, "domains"), "id").text = str(domain)
    for name, value in _DOMAIN_RULE:
        Xml.SubElement(rule, name).text = value
    topics = Xml.SubElement(Xml.SubElement(rule, "topic_access_rules"), "topic_rule")
    for name, value in _TOPIC_RULE:
        Xml.SubElement(topics, name).text = value
    return _text(root)


def _of_pages(access: Access, known: Iterable[Interface]) -> _Granted:
    """Return the permissions of pages: services of viewers, and all names of operators and engineers."""
    granted: _Granted = {}
    for names, commands in ((access.viewer, False), ((*access.operator, *access.engineer), True)):
        for name in names:
            for (kind, full), reason in _named(name, known).items():
                if kind == "service" or commands:
                    granted[kind, _MAY[kind][0 if kind == "topic" else 1], full] = reason
    return granted


def _named(pattern: str, known: Iterable[Interface]) -> dict[tuple[str, str], str]:
    """Return kind and name of the interfaces that a pattern of pages matches, with the reason.

    A name that is no pattern and of no known interface is permitted as every kind that it can be.
    """
    found: dict[tuple[str, str], str] = {
        (one.kind, one.name): _BY_PAGES for one in known if fnmatchcase(one.name, pattern)
    }
    if found or "*" in pattern:
        return found
    possible = ("service",) if ACTION in pattern else ("topic", "service", "action")
    return {(kind, pattern): _OF_OTHERS for kind in possible}


def _without_reading(granted: _Granted) -> _Granted:
    """Return permissions without those to subscribe, which one for all topics has."""
    return {one: reason for one, reason in granted.items() if one[:2] != ("topic", "subscribe")}


def _of_operators(known: Iterable[Interface], asked: Iterable[str], robot: str) -> _Granted:
    """Return the permissions of people's verbs: subscribe to all, call the orchestrator, be a node."""
    own = [one for one in known if one.is_housekeeping]
    services = {one.name.rpartition("/")[2] for one in own if one.kind == "service"}
    granted = [("topic", "publish", one.name) for one in own if one.kind == "topic"]
    granted += [("service", "reply", f"{robot}{node}/{service}") for node in _VERBS for service in services]
    granted += [("service", "request", name) for name in asked]
    return dict.fromkeys([("topic", "subscribe", "/*"), *granted], _BY_VERBS)


def _without_parts(granted: _Granted) -> _Granted:
    """Return permissions without those for the parts of actions that are permitted as a whole."""
    whole = {name for kind, _, name in granted if kind == "action"}
    return {
        one: reason
        for one, reason in granted.items()
        if ACTION not in one[2] or one[2].partition(ACTION)[0] not in whole
    }


def _fill(profile: Xml.Element, granted: _Granted) -> None:
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for (kind, may, name), reason in sorted(granted.items()):
        groups.setdefault((kind, may), []).append((reason, name))
    for (kind, may), names in groups.items():
        group = Xml.SubElement(profile, f"{kind}s", {may: "ALLOW"})
        before = ""
        for reason, name in sorted(names):
            if reason != before:
                group.append(Xml.Comment(f" {reason}: "))
            before = reason
            Xml.SubElement(group, kind).text = name


def _text(root: Xml.Element) -> str:
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"
