"""Permissions for SROS2: who may publish, hear, serve and call what, as `ros2 security` reads it.

Every node is an enclave of its own, `/lupin/NODE`; the verbs of people share one, `/lupin/operator`.
The form is that of policy.xsd of sros2 (0.2.0), and of the governance of OMG DDS-Security 1.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from types import MappingProxyType
from xml.etree import ElementTree as Xml

from lupin_engine.plugin.contract import Access
from lupin_engine.ros.adapter.network import ACTION, Interface
from lupin_engine.ros.adapter.node import OPERATOR_ENCLAVE, enclave_of
from lupin_engine.ros.names import DIAGNOSTICS_TOPIC

_VERSION = "0.2.0"
#: Kind -> what an end that produces may do, and one that consumes, in the words of sros2.
_MAY: Mapping[str, tuple[str, str]] = MappingProxyType(
    {"topic": ("publish", "subscribe"), "service": ("reply", "request"), "action": ("execute", "call")}
)
#: What every node may: go by simulated time, should it be told to, and tell how it is.
_EVERY = (("topic", "subscribe", "/clock"), ("topic", "publish", DIAGNOSTICS_TOPIC))
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

#: Kind, what may be done, and the absolute name.
Permission = tuple[str, str, str]


def policy(declared: Iterable[Interface], pages: Mapping[str, Access]) -> str:
    """Return the policy.xml of nodes that declare these interfaces.

    `pages` says of nodes that serve people's pages, by full name, what those may use beside.
    """
    known = list(declared)
    allowed: dict[str, set[Permission]] = {}
    for one in known:
        for nodes, may in zip((one.producers, one.consumers), _MAY[one.kind], strict=True):
            for node in nodes:
                allowed.setdefault(node, {*_EVERY}).add((one.kind, may, one.name))
    for node, access in pages.items():
        allowed.setdefault(node, {*_EVERY}).update(_of_pages(access, known))
    allowed["/lupin_operator"] = _of_operators(known)
    root = Xml.Element("policy", version=_VERSION)
    enclaves = Xml.SubElement(root, "enclaves")
    for node in sorted(allowed):
        namespace, _, name = node.rpartition("/")
        path = OPERATOR_ENCLAVE if node == "/lupin_operator" else enclave_of(name)
        profiles = Xml.SubElement(Xml.SubElement(enclaves, "enclave", path=path), "profiles")
        profile = Xml.SubElement(profiles, "profile", ns=namespace or "/", node=name)
        _fill(profile, _without_parts(allowed[node]))
    return _text(root)


def governance(domain: int) -> str:
    """Return the governance.xml of a ROS domain: nobody without permissions, nothing in clear."""
    root = Xml.Element("dds")
    rule = Xml.SubElement(Xml.SubElement(root, "domain_access_rules"), "domain_rule")
    Xml.SubElement(Xml.SubElement(rule, "domains"), "id").text = str(domain)
    for name, value in _DOMAIN_RULE:
        Xml.SubElement(rule, name).text = value
    topics = Xml.SubElement(Xml.SubElement(rule, "topic_access_rules"), "topic_rule")
    for name, value in _TOPIC_RULE:
        Xml.SubElement(topics, name).text = value
    return _text(root)


def _of_pages(access: Access, known: Iterable[Interface]) -> Iterable[Permission]:
    """Yield what pages may do: read and ask what a viewer may, command the rest."""
    commands = (*access.operator, *access.engineer)
    for one in known:
        read, commanded = (any(fnmatchcase(one.name, p) for p in some) for some in (access.viewer, commands))
        if one.kind == "topic":
            if read or commanded:
                yield ("topic", "subscribe", one.name)
            if commanded:
                yield ("topic", "publish", one.name)
        elif read or commanded:
            yield (one.kind, _MAY[one.kind][1], one.name)


def _of_operators(known: Iterable[Interface]) -> set[Permission]:
    """Return what the verbs of people may do: hear all, as `record` and `graph` do, and ask whom we serve."""
    asked = {("service", "request", one.name) for one in known if one.kind == "service" and one.producers}
    own = {("topic", "publish", one.name) for one in known if one.is_housekeeping and one.kind == "topic"}
    return {("topic", "subscribe", "/*"), *asked, *own}


def _without_parts(allowed: Iterable[Permission]) -> Iterator[Permission]:
    """Yield permissions without those for the parts of actions that are permitted as a whole."""
    of_node = list(allowed)
    whole = {name for kind, _, name in of_node if kind == "action"}
    yield from (one for one in of_node if one[2].partition(ACTION)[0] not in whole or one[0] == "action")


def _fill(profile: Xml.Element, allowed: Iterable[Permission]) -> None:
    groups: dict[tuple[str, str], list[str]] = {}
    for kind, may, name in sorted(allowed):
        groups.setdefault((kind, may), []).append(name)
    for (kind, may), names in groups.items():
        group = Xml.SubElement(profile, f"{kind}s", {may: "ALLOW"})
        for name in names:
            Xml.SubElement(group, kind).text = name


def _text(root: Xml.Element) -> str:
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"
