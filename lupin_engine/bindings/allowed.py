"""Access control of bindings: plugins offer names, and the robot's `lupin.yaml` allows more.

Calling, sending goals, publishing and subscribing are separate rights. Wildcards of `lupin.yaml` never cover
topics that a plugin publishes, or that carry people's commands: the owner must write such a name in full.

The file is in the parent of the missions' folder, so that writing missions does not grant rights; only where
there is none, one in that folder counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from pydantic import Field

from lupin_engine.bindings.catalog import lupin_file
from lupin_engine.bindings.data import Binding
from lupin_engine.bindings.file import BindingNode, EndpointNode
from lupin_engine.chart.documents import Names
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import VERSION_HELP, Node, Version
from lupin_engine.chart.source import parse_bytes, read_bytes
from lupin_engine.chart.validation import Way, validate
from lupin_engine.errors import meant, or_else
from lupin_engine.plugin.registry import Catalog

#: Key of `allow` -> what stands under it, to people.
_CALLED: Mapping[str, str] = MappingProxyType(
    {
        "services": "call the service",
        "actions": "send goals to the action",
        "publish": "publish on the topic",
        "subscribe": "listen to the topic",
    }
)
#: The names of the orchestrator's own node.
_ENGINE = "/mission_orchestrator/*"


class AllowNode(Node):
    """The names that bindings may use beside those that plugins offer; `*` stands for any letters."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {"topics": ("a topic is listened to or published on", "write 'subscribe: [...]' or 'publish: [...]'")}
    )

    services: Names = Field(default_factory=list, description="services that may be called")
    actions: Names = Field(default_factory=list, description="actions that may get goals")
    publish: Names = Field(default_factory=list, description="topics that may be published on")
    subscribe: Names = Field(default_factory=list, description="topics that may be listened to")


class RobotNode(Node):
    """`lupin.yaml`: the settings of a robot's owner for all missions."""

    lupin: Version = Field(None, description=VERSION_HELP)
    allow: AllowNode | None = Field(None, description="what bindings may reach")


def check_allowed(bindings: Iterable[Binding], catalog: Catalog, findings: Findings) -> None:
    """Report the endpoints that no plugin offers and `lupin.yaml` does not allow."""
    for binding in bindings:
        file = lupin_file(Path(binding.node.place.file).parent.parent)
        allowed = _read(file, findings) if file.is_file() else {}
        if allowed is None:
            continue  # what is wrong with it has been told
        for key, path, endpoint in _endpoints(binding.node):
            name = _absolute(endpoint.name)
            refusal = _refusal(key, name, allowed.get(key, []), file, catalog, common=endpoint.common)
            if refusal:
                findings.add(endpoint.at("name"), "not-allowed", path, *refusal)
            if key == "subscribe" and (plugin := _old_owner(name, catalog)):
                problem = f"plugin {plugin!r} declares the topic {name!r} under 'serves', among services"
                hint = f"write publishes=({name!r},) in its catalog"
                findings.warn(endpoint.at("name"), "not-allowed", path, problem, hint)


def _refusal(
    key: str, name: str, patterns: list[str], file: Path, catalog: Catalog, *, common: bool
) -> tuple[str, str] | None:
    """Return the problem with a name that no plugin offers and no setting allows, and a hint; else None.

    What plugins offer, and wildcards, are names of one robot: a `common` name must be written in full.
    """
    if not common and _is_offered(key, name, catalog):
        return None
    owner = _owner(key, name, catalog)
    in_full = common or bool(owner)
    if any(pattern == name or (not in_full and fnmatchcase(name, pattern)) for pattern in patterns):
        return None
    itself, belongs = ", without '*'," if in_full else "", f", which belongs to {owner}" if owner else ""
    hint = or_else(meant(name, patterns), f"write {name}{itself} under 'allow: {key}' in {file}")
    if key == "publish" and (plugin := _old_owner(name, catalog)):
        hint += f"; or let plugin {plugin!r} declare accepts=({name!r},)"
    of_all = " of all robots" if common else ""
    return f"it is not allowed to {_CALLED[key]} {name!r}{of_all}{belongs}", hint


def _is_offered(key: str, name: str, catalog: Catalog) -> bool:
    """Return whether a plugin offers a name for this kind of use."""
    for plugin in catalog.plugins.values():
        heard = (*plugin.publishes, *plugin.serves)  # catalogs of before have topics among the services
        offered = {"publish": plugin.accepts, "subscribe": heard}.get(key, plugin.serves)
        if name in map(_absolute, offered):
            return True
    return False


def _old_owner(name: str, catalog: Catalog) -> str:
    """Return the plugin that declares a topic in `serves`, as older plugins do; '' for none."""
    plugins = catalog.plugins.items()
    return next((owner for owner, plugin in plugins if name in map(_absolute, plugin.serves)), "")


def _owner(key: str, name: str, catalog: Catalog) -> str:
    """Return who else publishes a topic, or takes commands by it; '' for a free name."""
    if key == "subscribe":
        return ""
    profile = catalog.profile
    owned = [("the engine", [_ENGINE]), *((f"plugin {n!r}", p.publishes) for n, p in catalog.plugins.items())]
    access = [(f"plugin {n!r}", p.access) for n, p in catalog.plugins.items()]
    for owner, one in (*access, (f"profile {profile.name!r}", profile.access)):
        owned.append((owner, (*one.operator, *one.engineer, *(one.viewer if key == "publish" else ()))))
    if (wire := profile.wire) is not None:
        requests = (wire.requests.format(request) for request in profile.requests)
        topics = (wire.state.name, wire.outcomes.name)
        owned.append(("the orchestrator", (wire.start.name, *requests, *topics)))
    return next((o for o, names in owned if any(fnmatchcase(name, _absolute(n)) for n in names)), "")


def _read(file: Path, findings: Findings) -> Mapping[str, list[str]] | None:
    """Return the names under each key of `allow`; None after findings."""
    raw = read_bytes(file, findings)
    parsed = None if raw is None else parse_bytes(raw, str(file), findings)
    left_out: list[Way] = []
    node = None if parsed is None else validate(parsed, RobotNode, findings, left_out)
    if node is None or left_out:
        return None
    if node.allow is None:
        return {}
    allowed: dict[str, list[str]] = {key: getattr(node.allow, key) for key in _CALLED}
    for key, patterns in allowed.items():
        for index, pattern in enumerate(patterns):
            if not pattern.startswith(("/", "~/")):
                problem, hint = f"{pattern!r} is no absolute name", f"write '/{pattern}'"
                findings.add(node.allow.at(key, index), "bad-name", f"allow.{key}", problem, hint)
    return allowed


def _endpoints(node: BindingNode) -> Iterator[tuple[str, str, EndpointNode]]:
    """Yield all endpoints of a binding, with the key of `allow` and its path in the file."""
    for name, operation in node.operations.items():
        for key, called in (("services", operation.service), ("actions", operation.action)):
            if called is not None:
                yield key, f"operations.{name}.{key[:-1]}", called
    for key, family in (("publish", "actions"), ("subscribe", "values"), ("subscribe", "events")):
        for name, each in getattr(node, family).items():
            yield key, f"{family}.{name}.topic", each.topic


def _absolute(name: str) -> str:
    return name if name.startswith(("/", "~/")) else f"/{name}"
