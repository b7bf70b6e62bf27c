"""Composes documents to one chart: states filled, targets resolved, expressions typed and compiled.

The order is: declarations of all files; the tree, so that every full name exists; then the states from the
root down, each in the scope of its file's declarations, its mission's request and the itineraries around it.
A part is composed once for every use, because the scope of its expressions differs; its mistakes are reported
once.

Every step continues after a finding. The result is a usable chart only when there are no errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

from lupin_engine.chart.compose.actions import ActionReader, raised_events
from lupin_engine.chart.compose.carried import Carried, carries_something, end_of
from lupin_engine.chart.compose.declare import (
    Declared,
    Declarer,
    check_code,
    check_status,
    level_events,
    read_refusals,
)
from lupin_engine.chart.compose.diverts import Diverts
from lupin_engine.chart.compose.invoke import PERIOD, InvokeReader
from lupin_engine.chart.compose.outs import Outs
from lupin_engine.chart.compose.timeless import own_name, read_property, timeless
from lupin_engine.chart.compose.transitions import CompositionContext, TransitionReader, any_event, path_of
from lupin_engine.chart.compose.tree import Draft, Forest, UsedNode, each_once, texts_of
from lupin_engine.chart.compose.used import UsedMissionReader
from lupin_engine.chart.documents import (
    ActionNode,
    BudgetNode,
    FileNode,
    ItineraryNode,
    LifecycleNode,
    MissionNode,
    PartNode,
    PropertyNode,
    StateNode,
    written_in,
)
from lupin_engine.chart.expressions.checker import check_expression
from lupin_engine.chart.expressions.evaluation import Constant, Value
from lupin_engine.chart.expressions.scope import Scope, Typed, Usage, fragment_of, literal
from lupin_engine.chart.expressions.texts import check_text
from lupin_engine.chart.expressions.units import with_article
from lupin_engine.chart.expressions.values import (
    PerElement,
    is_expression,
    read_constant,
    read_guard,
    read_key,
    read_list,
    read_per_element,
    read_value,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import (
    ActionCall,
    Chart,
    Field,
    Invariant,
    Itinerary,
    Kind,
    Mission,
    State,
    TemporalProperty,
    Timer,
)
from lupin_engine.chart.source import Text
from lupin_engine.errors import Place, nearest
from lupin_engine.plugin.builtin import BUILTIN, MAX_TARGETS, TIME_ZONE
from lupin_engine.plugin.contract import Code, Parameter
from lupin_engine.plugin.profile import ANSWER
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import ANY, BOOL, COUNT, DURATION, TIME_OF_DAY, Type

#: What expressions see of the itinerary around them.
ITINERARY = Type(
    "record",
    "itinerary",
    fields={"open": BOOL, "remaining": COUNT, "total": COUNT, "closed": COUNT, "sweep": COUNT},
)
#: How often a chart is looked at for what its events carry, if one follows from another.
MAX_LEARNED = 4


@dataclass
class Composed:
    """A chart with the further data that the checks need."""

    chart: Chart
    drafts: Mapping[str, Draft]
    usage: Usage
    declared: Declared
    carried: Carried


def compose(
    lifecycle: LifecycleNode,
    missions: Sequence[MissionNode],
    parts: Mapping[str, UsedNode],
    catalog: Catalog,
    findings: Findings,
) -> Composed | None:
    """Compose the chart of these documents; parts with errors are left out, and the rest may be checked.

    `missions` are those that can be started, `parts` the parts and missions that states use. None where the
    profile is unknown: of several profiles the lifecycle must name one.
    """
    profiled = _with_profile(catalog, lifecycle, findings)
    return None if profiled is None else _Composer(lifecycle, missions, parts, profiled, findings).compose()


def _with_profile(catalog: Catalog, lifecycle: LifecycleNode, findings: Findings) -> Catalog | None:
    """Return the catalog with the profile that a lifecycle names, else with the only one installed.

    None after a finding: the name is unknown, or none is written where several are installed.
    """
    name, known = lifecycle.profile, catalog.profiles
    if name is None:
        if len(known) > 1:
            problem, hint = f"several profiles are installed: {', '.join(known)}", "write 'profile: NAME'"
            findings.add(lifecycle.place, "missing-key", "profile", problem, hint)
            return None
        return catalog
    if name not in known:
        hint = (
            f"{nearest(name, known)} or install the package that has it: pip install --editable lupin-{name}"
        )
        problem = f"unknown profile {str(name)!r}"
        findings.add(lifecycle.at("profile"), "unknown-profile", "profile", problem, hint)
        return None
    return catalog.with_profile(name)


class _Composer:
    def __init__(
        self,
        lifecycle: LifecycleNode,
        missions: Sequence[MissionNode],
        parts: Mapping[str, UsedNode],
        catalog: Catalog,
        findings: Findings,
        carried: Carried | None = None,
    ) -> None:
        self._lifecycle = lifecycle
        self._missions = list(missions)
        self._parts = parts
        self._files = each_once([lifecycle, *missions, *parts.values()])
        #: Those that can be started, and those that are only used.
        self._requested = [file for file in self._files if isinstance(file, MissionNode)]
        self._catalog = catalog
        self._findings = findings
        self._usage = Usage()
        self._declarer = Declarer(catalog, findings, self._usage)
        self._outs = Outs(self._declarer, findings)
        self._forest = Forest(parts, findings)
        self._requests: dict[str, dict[str, Field]] = {}
        self._bases: dict[tuple[str, str, str], Scope] = {}
        self._bound: dict[str, list[set[str]]] = {}
        self._codes: dict[str, Code] = {}
        self._events: dict[str, None] = {}
        self._carried = carried

    @property
    def _declared(self) -> Declared:
        return self._declarer.declared

    def compose(self) -> Composed:
        """Run all steps."""
        files = self._files
        self._declarer.name_holds(self._lifecycle)
        self._declarer.read(files)
        self._forest.grow(self._lifecycle, self._missions)
        diverts = Diverts(self._forest, self._findings)
        diverts.declare(self._declared.context)
        self._codes = self._all_codes()
        self._events = self._all_events()
        carried = self._carried = self._carried or self._learn()
        self._actions = ActionReader(
            self._catalog, self._declared.context, self._codes, carried, self._findings
        )
        self._invokes = InvokeReader(
            self._catalog, self._declarer, self._codes, self._actions, self._findings
        )
        context = CompositionContext(
            self._catalog,
            self._declared,
            self._forest,
            self._codes,
            self._events,
            carried,
            self._outer,
            self._findings,
        )
        self._transitions = TransitionReader(context, self._actions)
        self._uses = UsedMissionReader(context, self._actions, self._requests)
        self._read_requests()
        states = diverts.put_off({draft.name: self._state(draft) for draft in self._forest.drafts.values()})
        holds_scope = self._base(self._lifecycle)
        holds = self._declarer.holds(self._lifecycle, holds_scope, self._codes)
        chart = Chart(
            name=self._lifecycle.lifecycle,
            files=tuple(dict.fromkeys((*self._lifecycle.files, *(file.place.file for file in files)))),
            states=states,
            missions=self._mission_records(),
            holds=holds,
            context=self._declared.context,
            inputs=self._declared.inputs,
            parameters={},
            codes=self._codes,
            invariants=self._invariants(files),
            properties=self._properties(files),
            summary=self._lifecycle.summary,
            catalog=self._catalog,
            lifecycle_files=self._lifecycle.files,
            extends=self._lifecycle.extends or "",
        )
        plugins = self._plugins()
        chart = replace(chart, plugins=plugins)
        chart = replace(chart, parameters=self._parameters(chart.clients))
        return Composed(chart, self._forest.drafts, self._usage, self._declared, carried)

    def _learn(self) -> Carried:
        """Return the payload types of events and results, inferred in passes to a fixed point."""
        drafts = self._forest.drafts.values()
        if not any(map(carries_something, drafts)):
            return Carried(self._findings)
        discarded = Findings()
        carried = Carried(discarded, {}, ANY)
        for _ in range(MAX_LEARNED):
            files = (self._lifecycle, self._missions, self._parts)
            _Composer(*files, self._catalog, discarded, carried).compose()
            if carried.found == carried.known:
                break
            carried = Carried(discarded, carried.found, ANY)
        return Carried(self._findings, carried.found)

    # -- what the whole chart knows ------------------------------------------------------------------------

    def _all_codes(self) -> dict[str, Code]:
        """Join declared codes with those of the operations and request types that the chart uses."""
        codes = dict(self._declared.codes)
        for name in dict.fromkeys(chain.from_iterable(map(_invoked, self._forest.drafts.values()))):
            operation = self._catalog.operations.get(name)
            for code in operation.codes if operation else ():
                codes.setdefault(code.name, code)
        for mission in self._requested:
            for node in mission.request.values():
                reader = self._catalog.readers.get(node.type.split()[-1] if node.type else "")
                if reader is not None:
                    codes.setdefault(reader.code.name, reader.code)
        return codes

    def _all_events(self) -> dict[str, None]:
        """Return the events that can arrive, as the keys of a mapping: they are looked up for every `on`."""
        raised = set(raised_events(a for draft in self._forest.drafts.values() for a in _actions(draft)))
        levels = level_events(self._declared.inputs)
        drafts = self._forest.drafts.values()
        asks = [draft.node.ask for draft in drafts if draft.node is not None and draft.node.ask is not None]
        answers = [f"{ANSWER}{name}" for ask in asks for name in ask.choices]
        return dict.fromkeys(
            [*self._catalog.profile.events, *answers, *levels, *self._catalog.events, *sorted(raised)]
        )

    def _plugins(self) -> tuple[str, ...]:
        """Return the plugins that anything of theirs is used from, sorted, without the built-in one."""
        names = self._invokes.used | (self._actions.used & self._catalog.actions.keys())
        for event in self._transitions.heard:
            names.update(self._plugin_events(event))
        found = {name.partition(".")[0] for name in names}
        owners = self._catalog.owners
        used: list[tuple[str, Iterable[str]]] = [
            ("function", self._usage.functions),
            ("parameter", self._usage.parameters),
            ("type", self._declared.types),
            ("value", [found.value for found in self._declared.inputs.values()]),
        ]
        found.update(
            owners[family, name] for family, some in used for name in some if (family, name) in owners
        )
        return tuple(sorted(found - {BUILTIN}))

    def _plugin_events(self, event: str) -> list[str]:
        """Return the plugins' events that a transition names, by a prefix or in full; `*` names none."""
        if event.endswith(".*"):
            return [name for name in self._catalog.events if name.startswith(event[:-1])]
        return [event] if event in self._catalog.events else []

    def _always_given(self) -> Iterator[str]:
        """Yield the parameters that only one part declares, and that every use of it gives a value."""
        for part in self._parts.values():
            uses = self._bound.get(part.title, [])
            others = [own for title, own in self._declared.by_file.items() if title != part.title]
            for name in set.intersection(*uses) if uses else ():
                if not any(name in own for own in others):
                    yield name

    def _parameters(self, plugins: Iterable[str]) -> dict[str, Parameter]:
        """Return the settings of the chart, sorted by where they come from: plugins, then files.

        A part's parameter that every use gives a value cannot be set from outside.
        """
        found: dict[str, Parameter] = {}
        for plugin in plugins:
            found.update(self._catalog.plugins[plugin].parameters)
        for name in self._always_given():
            self._declared.parameters.pop(name, None)
        if TIME_ZONE in self._usage.parameters:
            found[TIME_ZONE] = self._catalog.parameters[TIME_ZONE]
        if any(asked.type.kind == "list" for each in self._requests.values() for asked in each.values()):
            found[MAX_TARGETS] = self._catalog.parameters[MAX_TARGETS]
        found.update(self._declared.parameters)
        for file in (self._lifecycle, *self._missions, *self._parts.values()):
            for name in file.params.keys() & self._declared.parameters.keys():
                kind, place = self._declared.parameters[name].type, file.key_at("params", name)
                self._declarer.check_settable(name, kind, file.params[name], place)
        return found

    # -- missions ------------------------------------------------------------------------------------------

    def _read_requests(self) -> None:
        for mission in self._requested:
            scope = self._scope_of(mission)
            fields: dict[str, Field] = {}
            for name, node in mission.request.items():
                place = mission.key_at("request", name)
                found = self._declarer.field(name, node, place, scope, set(self._codes))
                if found is not None:
                    fields[name] = found
            if mission.name in self._requests:
                problem = f"a second mission is called {mission.mission!r}"
                self._findings.add(mission.at("mission"), "conflicting-definition", "mission", problem)
                continue
            self._requests[mission.name] = fields
            scope = self._scope_of(mission, mission.name)
            for name, field in fields.items():
                node, path = mission.request[name], f"request.{name}"
                refusals = read_refusals(node, scope, self._codes, self._findings, path)
                fields[name] = replace(field, refusals=refusals)

    def _mission_records(self) -> dict[str, Mission]:
        found = {}
        for mission in self._missions:
            wrapper = next(
                (
                    d
                    for d in self._forest.drafts.values()
                    if d.file is mission and d.parent is not None and d.parent.slot
                ),
                None,
            )
            if wrapper is not None:
                place = mission.at("mission")
                request = self._requests[mission.name]
                found[mission.name] = Mission(
                    mission.name, wrapper.name, place.file, mission.summary, request, place
                )
        return found

    # -- at all times --------------------------------------------------------------------------------------

    def _invariants(self, files: Iterable[FileNode]) -> dict[str, Invariant]:
        """Read the invariants of all files; each has a name of its own in the whole chart."""
        found: dict[str, Invariant] = {}
        for file in files:
            for name, node in file.invariants.items():
                place, path = file.key_at("invariants", name), f"invariants.{name}"
                if not self._is_new("invariant", name, place, path, found):
                    continue
                at = node.at("that") if node.written else file.value_at("invariants", name)
                with self._at_all_times(file, "invariant", at, path) as scope:
                    that = read_guard(node.that, at, scope, self._findings, path)
                if that is not None:
                    found[name] = Invariant(name, that, place, node.summary)
        return found

    def _properties(self, files: Iterable[FileNode]) -> dict[str, TemporalProperty]:
        """Read the properties of all files; each has a name of its own in the whole chart."""
        found: dict[str, TemporalProperty] = {}
        former: dict[str, str] = {}
        for file in files:
            for name, node in file.properties.items():
                self._property(file, name, node, found)
                former |= {node.formerly: name} if node.formerly else {}
        for mission in self._requested:
            self._not_meant(mission, found, former)
        return found

    def _property(
        self, file: FileNode, name: str, node: PropertyNode, found: dict[str, TemporalProperty]
    ) -> None:
        """Add a property of a file, unless its name or it itself is wrong."""
        place, path = file.key_at("properties", name), f"properties.{name}"
        own = own_name(name, node, place, self._findings)
        if not own or not self._is_new("property", own, place, path, found):
            return
        about = file.name if isinstance(file, MissionNode) else ""
        with self._at_all_times(file, "property", node.place, path) as scope:
            read = read_property(own, node, place, scope, self._findings, about)
        if node.code is not None:
            check_code(node.code, node.at("code"), f"{path}.code", self._codes, self._findings)
        if read is not None:
            found[own] = read

    def _not_meant(
        self, mission: MissionNode, found: dict[str, TemporalProperty], former: Mapping[str, str]
    ) -> None:
        """Note the inherited properties that a mission does not mean; former names have their new ones."""
        inherited = [name for name in found if name not in mission.properties]
        for name, why in mission.not_meant.items():
            place, path = mission.key_at("not_meant", name), f"not_meant.{name}"
            if name in former and name not in found:
                problem, name = f"the property {name!r} is called {former[name]!r} now", former[name]
                self._findings.warn(place, "unknown-property", path, problem, f"write '{name}: REASON'")
            if name in mission.properties:
                problem = f"the property {name!r} stands in this file"
                self._findings.add(place, "conflicting-definition", path, problem, "remove one of the two")
            elif name not in inherited:
                self._findings.unknown(place, "unknown-property", path, "inherited property", name, inherited)
            elif not (why or "").strip():
                problem = f"there is no reason why {name!r} is not meant"
                self._findings.add(place, "missing-key", path, problem, f"write '{name}: REASON'")
            else:
                known = found[name]
                found[name] = replace(known, not_meant={**known.not_meant, mission.name: str(why)})

    def _is_new(
        self, what: str, name: str, place: Place, path: str, known: Mapping[str, Invariant | TemporalProperty]
    ) -> bool:
        if not self._declarer.good_name(what, name, place, path):
            return False
        if name not in known:
            return True
        problem = f"a second {what} is called {name!r}, after {known[name].place}"
        self._findings.add(place, "conflicting-definition", path, problem, "rename one")
        return False

    @contextmanager
    def _at_all_times(self, file: FileNode, what: str, place: Place, path: str) -> Iterator[Scope]:
        """Yield the scope of such a condition, without values that differ between uses of its part."""
        usage = Usage()
        mission = file.name if isinstance(file, MissionNode) else ""
        yield replace(timeless(self._scope_of(file, mission), what, self._catalog, self._codes), usage=usage)
        for family in ("parameters", "functions", "inputs"):
            getattr(self._usage, family).update(getattr(usage, family))
        given = set().union(*self._bound.get(file.title, []))
        for name in sorted(given & usage.parameters):
            problem = f"param.{name} is given by a use of the part, so it has no value outside of it"
            hint = f"write the {what} without it, or let no use of the part set it"
            self._findings.add(place, "unknown-parameter", path, problem, hint)

    # -- scopes --------------------------------------------------------------------------------------------

    def _scope_of(self, file: FileNode, mission: str = "", within: str = "") -> Scope:
        base = self._declarer.base_scope(file)
        states = tuple(name for name in self._forest.drafts if name)
        scope = replace(base, states=states, open_states=file is self._lifecycle, within=within)
        used = self._forest.drafts[within].part if within else None
        requested = used.name if isinstance(used, MissionNode) else mission
        if not requested or requested not in self._requests:
            return scope
        fields = {name: found.type for name, found in self._requests[requested].items()}
        return scope.with_names({"request": Type("record", "request", fields=fields)})

    def _base(self, file: FileNode, mission: str = "", within: str = "") -> Scope:
        """Return the scope of a file in a mission, or in a state that uses one."""
        key = (file.title, mission, within)
        if key not in self._bases:
            self._bases[key] = self._scope_of(file, mission, within)
        return self._bases[key]

    def _outer(self, draft: Draft) -> Scope:
        """Return the scope around a state: its parent's inner scope, or its file's where a file begins."""
        parent = draft.parent
        if parent is None or parent.inner is None or (draft.node is None and draft.kind is not Kind.HISTORY):
            return self._base(draft.file, draft.mission)
        return parent.inner

    # -- states --------------------------------------------------------------------------------------------

    def _state(self, draft: Draft) -> State:
        outer = self._outer(draft)
        node = draft.node
        draft.scope = draft.inner = outer
        itinerary = None
        if node is not None and node.itinerary is not None:
            itinerary, draft.scope = self._itinerary(draft, node.itinerary, outer)
            draft.inner = draft.scope
        if node is not None and node.use is not None:
            draft.inner = self._part_scope(draft, node, draft.scope)
        initial = self._initial(draft)
        return State(
            draft.name,
            draft.kind,
            draft.place,
            draft.parent.name if draft.parent else None,
            tuple([child.name for child in draft.children.values()]),
            initial,
            draft.label,
            draft.mission,
            draft.slot,
            depth=draft.depth,
            itinerary=itinerary,
            **self._written(draft),
        )

    def _written(self, draft: Draft) -> dict[str, Any]:
        """Return the fields of a state that its text declares."""
        if draft.node is not None:
            return self._of_state(draft, draft.node)
        return self._of_file(draft) if draft.kind is not Kind.HISTORY else {}

    def _of_file(self, draft: Draft) -> dict[str, Any]:
        """Return the fields that the file declares for the root, or for the wrapper of a mission."""
        file, scope = draft.file, any_event(draft)
        entry = file.entry if isinstance(file, MissionNode) else []
        leave = file.exit if isinstance(file, MissionNode) else []
        handlers = file.on if isinstance(file, (LifecycleNode, MissionNode)) else {}
        return {
            "summary": file.summary,
            "entry": self._read_actions(entry, scope, draft, "entry"),
            "exit": self._read_actions(leave, scope, draft, "exit"),
            "transitions": tuple(self._transitions.handlers(draft, file, handlers)),
        }

    def _of_state(self, draft: Draft, node: StateNode) -> dict[str, Any]:
        scope = any_event(draft)
        works = draft.kind is not Kind.FINAL and draft.kind is not Kind.HISTORY
        assert draft.scope is not None
        invoke = None
        found: dict[str, Any] = {"summary": node.summary, "phase": node.phase, "paused": node.paused}
        if isinstance(draft.part, MissionNode):
            found["use"] = self._uses.read(draft, node, draft.part)
        if node.invoke and works:
            invoke = self._invokes.read(node.invoke, scope, path_of(draft.name, "invoke"))
            found["invoke"] = invoke
        if node.for_each and works:
            path = path_of(draft.name, "for_each")
            found["for_each"] = self._invokes.for_each(node.for_each, draft.scope, path)
        if node.ask and works:
            found["ask"] = self._transitions.ask(draft, node.ask)
        if node.budget and works:
            found["budget"] = self._budget(draft, node.budget)
        if node.entry:
            found["entry"] = self._read_actions(node.entry, scope, draft, "entry")
        if draft.kind is Kind.FINAL:
            found["result"] = self._result(draft, node, scope)
        if node.exit:
            found["exit"] = self._read_actions(node.exit, scope, draft, "exit")
        used = self._transitions.of_used(draft)
        found["transitions"] = (*used, *self._transitions.read(draft, node, invoke, scope))
        if node.after or node.every or node.at_:
            found["timers"] = tuple(self._timers(draft, node, scope))
        found["resume_at"] = self._transitions.resume_at(draft, node)
        return found

    def _result(self, draft: Draft, node: StateNode, scope: Scope) -> Mapping[str, Value]:
        """Read the done data of a state; one without a result counts as well."""
        path = path_of(draft.name, "result")
        assert self._carried is not None
        assert draft.parent is not None
        given = node.mapping("result")
        place = node.key_at("result") if given is not None else draft.place
        return self._carried.read(end_of(draft.parent.name), given, place, scope, path)

    def _read_actions(
        self, nodes: Sequence[ActionNode], scope: Scope, draft: Draft, key: str
    ) -> tuple[ActionCall, ...]:
        return self._actions.read(nodes, scope, path_of(draft.name, key))

    def _initial(self, draft: Draft) -> str | None:
        """Return the full name of the initial child; None without one, and after findings."""
        written = draft.initial
        if draft.kind is Kind.HISTORY:
            siblings = draft.parent
            if written is None or siblings is None:
                return None
            return self._forest.resolve_child(
                written[0], siblings, written[1], path_of(draft.name, "initial")
            )
        if draft.kind is Kind.PARALLEL and written is not None:
            problem = "every child of a parallel state is entered, none of them first"
            self._findings.add(written[1], "wrong-shape", draft.name, problem, "leave 'initial' out")
            return None
        if written is not None:
            return self._forest.resolve_child(written[0], draft, written[1], path_of(draft.name, "initial"))
        if draft.kind is not Kind.COMPOUND:
            return None
        return self._only_child(draft)

    def _only_child(self, draft: Draft) -> str | None:
        """Return the child to enter where no initial one is written: the only one that is not final.

        A final state counts where there is no other; a history never does. None where several are left, or
        none; that is a finding, except in the slot for missions (and, for none, where a part is embedded).
        """
        proper = [child for child in draft.children.values() if child.kind not in (Kind.FINAL, Kind.HISTORY)]
        proper = proper or [child for child in draft.children.values() if child.kind is not Kind.HISTORY]
        if len(proper) == 1:
            return proper[0].name
        if not proper and not draft.slot and draft.part is None:
            problem = "nothing inside this state can be entered"
            self._findings.add(draft.place, "no-initial", draft.name, problem, "add a state inside")
        if proper and not draft.slot:
            names = ", ".join(repr(child.local) for child in proper)
            problem = f"it is not said which of {names} is entered first"
            self._findings.add(
                draft.place, "no-initial", draft.name, problem, f"write 'initial: {proper[0].local}'"
            )
        return None

    def _itinerary(self, draft: Draft, node: ItineraryNode, outer: Scope) -> tuple[Itinerary | None, Scope]:
        path = path_of(draft.name, "itinerary")
        items = read_list(node.items, node.at("items"), outer, self._findings, f"{path}.items")
        item = (items.type.item if items is not None else None) or ANY
        self._check_identity(item, node.at("items"), f"{path}.items")
        self._check_repetition(items, node, f"{path}.items")
        sweeps = read_key(node, "sweeps", COUNT, outer, self._findings, path)
        order = None
        if node.order is not None:
            each = outer.without("itinerary", "it is not decided yet which target is next")
            each = each.with_names({"target": item})
            order = read_per_element(
                node, "order", PerElement("target", item, ("number",)), each, self._findings, path
            )
        inner = outer.with_names({"target": item, "itinerary": ITINERARY})
        if items is None:
            return None, inner
        again, leaves_open = self._again(node, path), node.on_abort == "leave_open"
        return Itinerary(items, node.place, order, sweeps, again, leaves_open, node.source), inner

    def _again(self, node: ItineraryNode, path: str) -> tuple[str, ...]:
        """Return the statuses after which a target is visited once more; findings for unknown ones."""
        allowed = self._catalog.profile.statuses
        if "again" in node.model_fields_set and not node.again:
            problem, hint = "the list of statuses is empty", f"write one of these: {', '.join(allowed)}"
            self._findings.add(node.at("again"), "wrong-shape", f"{path}.again", problem, hint)
        for index, status in enumerate(node.again):
            check_status(str(status), node.at("again", index), f"{path}.again", allowed, self._findings)
        return tuple(map(str, node.again))

    def _check_identity(self, item: Type, place: Place, path: str) -> None:
        """Report targets without an `id`, by which published messages name them."""
        own = item.fields.get("id", item) if item.kind == "record" else item
        if own.kind not in ("any", "text", "integer"):
            problem = f"a target is told by its 'id', and {with_article(item)} has none"
            hint = "give each an 'id', as in {id: gate, x: 1 m, ...}, or walk a list of text"
            self._findings.add(place, "wrong-type", path, problem, hint)

    def _check_repetition(self, items: Value | None, node: ItineraryNode, path: str) -> None:
        """Warn of targets that differ and have one `id`, in a list that is known before a run."""
        first: dict[Any, int] = {}
        targets = self._known_targets(items)
        for index, target in enumerate(targets):
            name = target.get("id") if isinstance(target, Mapping) else None
            before = first.setdefault(name, index) if isinstance(name, (str, int)) else index
            if targets[before] != target:
                problem = f"targets {before} and {index} differ and are both called {name!r}"
                place = node.at("items", index) if isinstance(items, Constant) else node.at("items")
                hint = "outcomes name a target by its 'id': give each its own"
                self._findings.warn(place, "repeated-target", path, f"{problem}, counted from 0", hint)

    def _known_targets(self, items: Value | None) -> Sequence[Any]:
        """Return the targets of a written list, or of a parameter or variable with its default."""
        if items is None or isinstance(items, Constant):
            found: Any = None if items is None else items.value
        elif items.source in self._declared.context:
            return self._known_targets(self._declared.context[items.source].default)
        else:
            parameter = self._declared.parameters.get(items.source.removeprefix("param."))
            found = parameter.default if parameter and items.source.startswith("param.") else None
        return found if isinstance(found, list) else ()

    def _part_scope(self, draft: Draft, node: StateNode, scope: Scope) -> Scope:
        """Return the scope of a part's states: the part's declarations, and the arguments of its use."""
        part = draft.part
        if part is None:
            return scope
        if isinstance(part, MissionNode):
            return self._base(part, draft.mission, draft.name)
        if part.needs == "itinerary" and "itinerary" in scope.absent:
            problem = f"the part {part.part!r} needs an itinerary"
            hint = "add 'itinerary: {items: ...}' to the state that uses it"
            self._findings.add(node.at("use"), "missing-itinerary", draft.name, problem, hint)
            scope = scope.with_names({"target": ANY, "itinerary": ITINERARY})
        base = self._base(part, draft.mission, draft.within)
        handed = {name: scope.names[name] for name in ("target", "itinerary") if name in scope.names}
        bound = self._bind(draft, node, part, scope)
        draft.out = self._outs.bind(draft, node, part, scope)
        known = self._declared.context
        types = {name: known[taken].type if taken else ANY for name, taken in draft.out.items()}
        return replace(base.with_names({**handed, **types}), bound=bound, out=draft.out)

    def _bind(self, draft: Draft, node: StateNode, part: PartNode, scope: Scope) -> dict[str, Typed]:
        """Read the values that a use gives to parameters of its part."""
        own = self._declared.by_file.get(part.title, {})
        found: dict[str, Typed] = {}
        for name, raw in node.with_.items():
            path, place = path_of(draft.name, f"with.{name}"), node.value_at("with", name)
            if name not in own:
                at = node.key_at("with", name)
                self._findings.unknown(at, "unknown-parameter", path, "parameter of the part", name, own)
                continue
            value = self._bound_value(raw, place, own[name].type, scope, path)
            if value is not None:
                found[name] = value._replace(type=own[name].type)
        for name, parameter in own.items():
            if parameter.default is None and name not in node.with_:
                path, problem = f"{draft.name}.with", f"the part {part.part!r} needs the parameter {name!r}"
                hint = f"add 'with: {{{name}: ...}}'"
                self._findings.add(node.at("use"), "missing-argument", path, problem, hint)
        self._bound.setdefault(part.title, []).append(set(found))
        return found

    def _bound_value(self, raw: Any, place: Place, wanted: Type, scope: Scope, path: str) -> Typed | None:
        fragment = fragment_of(raw) if isinstance(raw, Text) and is_expression(raw) else None
        if fragment is not None:
            return check_expression(fragment, scope, wanted, self._findings, path)
        if wanted.kind == "text" and isinstance(raw, Text) and "${" in raw:
            return check_text(raw, scope, self._findings, path)
        constant = read_constant(raw, place, wanted, self._findings, path)
        return literal(constant.value, wanted) if constant else None

    def _timers(self, draft: Draft, node: StateNode, scope: Scope) -> Iterator[Timer]:
        assert draft.scope is not None
        each_tick = draft.scope.without("event", "it is looked at again at every tick")
        each_day = draft.scope.without("event", "it is looked at again every day")
        if node.at_:
            self._usage.parameters.add(TIME_ZONE)
        for word, keys, wanted, seen in (
            ("after", node.after, DURATION, scope),
            ("every", node.every, PERIOD, each_tick),
            ("at", node.at_, TIME_OF_DAY, each_day),
        ):
            for index, key in enumerate(keys):
                text, event = node.text_of_key(word, key), f"{word}.{index}"
                path = path_of(draft.name, event)
                value = read_value(text, text.place, wanted, seen, self._findings, path)
                if value is not None:
                    yield Timer(event, value, text.place)

    def _budget(self, draft: Draft, node: BudgetNode) -> Timer | None:
        assert draft.scope is not None
        scope = draft.scope.without("event", "the time is counted over all visits")
        value = read_key(node, "after", DURATION, scope, self._findings, path_of(draft.name, "budget"))
        return None if value is None else Timer("budget", value, node.place, goes_on=node.during == "divert")


def _invoked(draft: Draft) -> Iterator[str]:
    """Yield the names of the operations that a state's text begins."""
    node = draft.node
    for invoke in (node.invoke, node.for_each.invoke if node.for_each else None) if node else ():
        if invoke is not None:
            yield invoke.do


def _actions(draft: Draft) -> Iterator[ActionNode]:
    """Yield every action that a state's text writes."""
    for node in texts_of(draft):
        yield from written_in(node, ActionNode)
