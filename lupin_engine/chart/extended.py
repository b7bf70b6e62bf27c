"""One lifecycle from two files: a project's own, and the shipped one that it extends.

The texts are merged before they are read as a document. So everything behind sees one lifecycle, in which
every key and value keeps the place where it is written. The models of the documents decide how: a mapping is
merged key by key; a transition, an action, a list and an expression replace, and so does an `invoke` with a
`do`.

An override of what stops the robot, or of what answers a start, is refused: no proof can vouch for a hold
that was rewritten.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin

from lupin_engine.chart.documents import (
    ActionNode,
    InvokeNode,
    LifecycleNode,
    PropertyNode,
    StateNode,
    TransitionNode,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Meaning, Named, Node
from lupin_engine.chart.semantics import matches
from lupin_engine.chart.source import Map, Merged, Seq, Text, map_at
from lupin_engine.chart.validation import Way
from lupin_engine.errors import Diagnostic, Place, meant
from lupin_engine.plugin.profile import START

_FIXED, _NOTHING = "not-overridable", "overrides-nothing"
#: The inputs and parameters that a condition reads.
_READ = re.compile(r"\b(input|param)\.(\w+)")
_SECTIONS = {"input": "inputs", "param": "params"}
#: How strictly a breach is answered.
_BREACHES = ("report", "hold", "fault")
#: The keys that an override of a property may have.
_OF_PROPERTY = frozenset({"breach", "code", "summary"})
_HELD = "every project is held and released in the same way"
_ANSWERED = "every project answers a start in the same way"
_KEPT = "every project keeps the conditions that it inherits"
_STRICTER = "write one of another name that asks for more"
_TYPED = "what reads it expects that type"
_SET = "remove it; a robot's own value is given to it as a parameter"
_BEGUN = "every robot begins by waiting for what it needs"
_NOT_MEANT = "a mission that it is not meant of names it under 'not_meant', with the reason"
#: The keys that each file has for itself.
_OWN_KEYS = frozenset({"lifecycle", "extends", "lupin"})


@dataclass(frozen=True)
class BaseFile:
    """The file of a lifecycle that is extended; `name` is the lifecycle's."""

    name: str
    file: str
    raw: bytes


def extended(own: Map, base: Map, findings: Findings, left_out: list[Way]) -> Map | None:
    """Return the lifecycle of a project merged with the one that it extends; None where that is not complete.

    A forbidden override is a finding and has no effect. A name that overrides nothing is a finding, too, and
    is added to `left_out`.
    """
    if "extends" in base:
        problem = f"{str(own['extends'])!r} extends a lifecycle itself, in {base.key_place('extends')}"
        hint = "extend one that is complete: a lifecycle is read in two files at most"
        findings.add(own.value_place("extends"), "unknown-lifecycle", "extends", problem, hint)
        return None
    _Additions(own, base, findings).check()
    return _Merger(own, base, findings, left_out).merged()


def with_override(one: Diagnostic, own: Map, base: str) -> Diagnostic:
    """Return a finding in the file `base` of an extended lifecycle with the place of what overrides there.

    That is the override with the longest way in common with the finding; without one nothing is added.
    """
    holder, place = own, None
    for word in one.path.split(".") if one.place.file == base else ():
        if word not in holder:
            holder = _inner(holder, "states")
        if word not in holder:
            break
        holder, place = _inner(holder, word), holder.key_place(word)
    if place is None:
        return one
    return replace(one, hint="; ".join(filter(None, (one.hint, f"look at the override in {place}"))))


class _Merger:
    def __init__(self, own: Map, base: Map, findings: Findings, left_out: list[Way]) -> None:
        self._own, self._base = own, base
        self._findings = findings
        self._left_out = left_out
        self._name = str(own["extends"])
        self._readers = dict(_readers(base))
        self._mentioned = frozenset(_words_in(own))

    def merged(self) -> Merged:
        """Merge the two files."""
        return self._record(self._own, self._base, LifecycleNode, ())

    def _record(self, own: Map, base: Map, model: type[Node], way: Way) -> Merged:
        """Merge the mapping of a model, key by key."""
        fields = _fields(model)
        return self._keys(own, base, way, {key: fields.get(key) for key in own})

    def _keys(self, own: Map, base: Map, way: Way, merges: Mapping[str, _Merge | None]) -> Merged:
        """Merge two mappings; `merges` says of each key how the values of both are merged."""
        found = Merged(own, base)
        for key in dict.fromkeys((*base, *own)):
            if key not in own:
                found.take(key, base[key], base)
            elif key not in base or (not way and key in _OWN_KEYS):
                found.take(key, own[key], own)
            else:
                found.take(key, *self._both(own, base, key, (*way, key), merges.get(key)))
        return found

    def _both(self, own: Map, base: Map, key: str, way: Way, merge: _Merge | None) -> tuple[Any, Map]:
        """Return the value of a key that both have, and the mapping that the key is taken from."""
        new, old = own[key], base[key]
        fixed = self._fixed(way, new, old)
        if fixed is not None and not _is_same(new, old):
            self._refuse(own.key_place(key), base.key_place(key), way, fixed)
            return old, base
        is_whole = merge is not None and merge.is_whole
        if new is None or new == {} or (new == [] and is_whole):
            problem = f"nothing is written here, and nothing of {self._name} can be taken out"
            hint = "write the keys that differ, or remove this one"
            self._findings.add(own.key_place(key), _NOTHING, _path(way), problem, hint)
            return old, base
        if merge is not None and isinstance(new, Map) and isinstance(old, Map):
            if merge.of_names:
                return self._names(new, old, merge, way), own
            if merge.record is not None and not (merge.record is InvokeNode and "do" in new):
                return self._record(new, old, merge.record, way), own
        if _is_same(new, old):
            problem = f"this is the same as in {self._name}, {base.key_place(key)}"
            self._findings.warn(own.key_place(key), _NOTHING, _path(way), problem, "remove it")
        return new, own

    def _names(self, own: Map, base: Map, merge: _Merge, way: Way) -> Merged:
        """Merge two mappings of names: their records key by key, values of another kind as a whole."""
        for name in [name for name in own if name not in base]:
            problem, hint = self._misspelt(name, own[name], base, merge, way)
            if problem:
                place = own.key_place(name)
                self._findings.add(place, _NOTHING, _path(way), problem, hint)
                self._left_out.append((*way, name))
                del own[name]
        return self._keys(own, base, way, dict.fromkeys(own, replace(merge, of_names=False)))

    def _misspelt(self, name: str, new: Any, base: Map, merge: _Merge, way: Way) -> tuple[str, str]:
        """Return problem and hint of a name that overrides nothing and cannot be new; empty texts else."""
        if merge.meaning is None:
            return "", ""
        what = merge.meaning.value
        near = meant(name, base)
        problem = f"{self._name} has no {what} {name!r}"
        if merge.record is StateNode:
            is_new = name in self._mentioned or not near
            return ("", "") if is_new else (problem, f"{near} Nothing leads to a new one")
        lacks = _lacks(merge.record, new)
        if not lacks:
            return "", ""
        return problem, f"{near} A new one needs {lacks}".lstrip()

    # -- what cannot be overridden -----------------------------------------------------------------------

    def _refuse(self, own: Place, base: Place, way: Way, fixed: _Fixed) -> None:
        problem = f"{fixed.what} of {self._name}, {base}, cannot be overridden: {fixed.why}"
        self._findings.add(own, _FIXED, _path(way), problem, fixed.hint)

    def _fixed(self, way: Way, new: Any, old: Any) -> _Fixed | None:
        """Return the subject of a forbidden override, with the reason; None for one that is allowed."""
        match way:
            case ("profile",):
                return _Fixed("the profile", "its states belong to that profile")
            case ("initial",):
                return _Fixed("the initial state", _BEGUN)
            case ("holds", name):
                return _Fixed(f"the hold {name!r}", _HELD)
            case (("inputs" | "params") as section, name) if (section, name) in self._readers:
                what = "input" if section == "inputs" else "parameter"
                reader = self._readers[str(section), str(name)]
                hint = "remove it" if section == "inputs" else _SET
                return _Fixed(f"the {what} {name!r}", f"{reader} reads it", hint)
            case (("params" | "context"), name, "type"):
                return _Fixed(f"the type of {name!r}", _TYPED)
            case ("invariants", name):
                return _Fixed(f"the invariant {name!r}", _KEPT, _STRICTER)
            case ("properties", name) if _is_weaker(new, old):
                return _Fixed(f"the property {name!r}", _KEPT, f"{_STRICTER}; {_NOT_MEANT}")
            case ("states", *_, "slot"):
                return _Fixed("the slot", "the missions stand in the inherited one")
        return _fixed_transition(way, old)


def _is_weaker(new: Any, old: Any) -> bool:
    """Say whether a property would be another one, or its breach be answered less strictly."""
    if not isinstance(new, Map) or not isinstance(old, Map):
        return True
    if any(key not in _OF_PROPERTY and not _is_same(new[key], old.get(key)) for key in new):
        return True
    breach, before = new.get("breach", _BREACHES[-1]), old.get("breach", _BREACHES[0])
    return breach in _BREACHES and _BREACHES.index(breach) < _BREACHES.index(before)


def _fixed_transition(way: Way, old: Any) -> _Fixed | None:
    """Return the transitions that an override must not replace, with the reason; None where it may."""
    *_, key = way
    in_names = len(way) > 1 and way[-2] in ("on", "after", "every", "at")
    merge = _fields(StateNode).get(str(way[-2] if in_names else key))
    if merge is None or not merge.is_transition or merge.of_names is not in_names:
        return None
    what = f"the transition under {key!r}"
    if in_names and way[-2] == "on" and matches(str(key), START):
        return _Fixed(what, _ANSWERED)
    written = {word for each in _elements(old) if isinstance(each, Map) for word in each}
    if "releases" in written:
        return _Fixed(what, "it releases a hold")
    return _Fixed(what, "it is taken during a hold") if "during" in written else None


class _Additions:
    """Finds additions of a project that would change the effect of a hold, or the answer to a start."""

    def __init__(self, own: Map, base: Map, findings: Findings) -> None:
        self._own, self._base = own, base
        self._findings = findings
        self._name = str(own["extends"])
        self._holds = _inner(base, "holds")
        states = _inner(base, "states").items()
        self._slots = {str(name) for name, state in states if isinstance(state, Map) and "slot" in state}
        self._engaging = dict(_requests_of(self._holds, "engage"))
        self._asking = {**dict(_requests_of(self._holds, "release")), **self._engaging}

    def check(self) -> None:
        """Report them all."""
        self._new_holds()
        self._codes_of_holds()
        self._releases(self._own, ())
        self._begins(self._own, ())
        self._answers(_inner(self._own, "on"), _inner(self._base, "on"), (), [])
        self._states(self._own, self._base, (), [])

    def _states(self, own: Map, base: Map | None, way: Way, around: list[Map]) -> None:
        inherited = _inner(base, "states")
        for name, state in _inner(own, "states").items():
            if isinstance(state, Map):
                self._state(state, inherited.get(name), (*way, "states", name), around)

    def _state(self, state: Map, inherited: Any, way: Way, around: list[Map]) -> None:
        base = inherited if isinstance(inherited, Map) else None
        self._releases(state, way)
        self._begins(state, way)
        within = around if base is None else [base, *around]
        self._answers(_inner(state, "on"), _inner(base, "on"), way, within)
        self._on_hold(_inner(state, "invoke"), _inner(base, "invoke"), way)
        self._states(state, base, way, within)

    def _refuse(self, place: Place, way: Way, problem: str, hint: str = "remove it") -> None:
        self._findings.add(place, _FIXED, _path(way), problem, hint)

    def _new_holds(self) -> None:
        """Report new holds that could refuse a request of an inherited one."""
        for name, hold in _inner(self._own, "holds").items():
            if name in self._holds or not isinstance(hold, Map):
                continue
            for key, asking in (("engage", self._asking), ("release", self._engaging)):
                taken = next((each for each in _elements(hold.get(key)) if str(each) in asking), None)
                if taken is not None:
                    problem = f"this asks for {self._request(str(taken))}: {_HELD}"
                    self._refuse(hold.key_place(key), ("holds", name, key), problem, "name another request")

    def _codes_of_holds(self) -> None:
        """Report another severity for the code of an inherited hold."""
        codes, inherited = _inner(self._own, "codes"), _inner(self._base, "codes")
        for name, hold in self._holds.items():
            for code in (hold.get(key) for key in ("code", "engage_code")):
                own, base = _inner(codes, str(code)), _inner(inherited, str(code))
                if "severity" in own and own["severity"] != base.get("severity"):
                    what = (
                        f"the hold {name!r} of {self._name}, {self._holds.key_place(name)}, reports this code"
                    )
                    problem = f"{what}: {_HELD}"
                    hint = "remove it; 'label' and 'advice' may differ"
                    self._refuse(own.key_place("severity"), ("codes", str(code), "severity"), problem, hint)

    def _releases(self, holder: Map, way: Way) -> None:
        """Report transitions that release an inherited hold."""
        for key, transition in _transitions_in(holder):
            if not isinstance(transition, Map):
                continue
            for hold in _elements(transition.get("releases", ())):
                if isinstance(hold, str) and hold in self._holds:
                    where = self._holds.key_place(str(hold))
                    what = f"this releases the hold {str(hold)!r} of {self._name}, {where}"
                    self._refuse(transition.key_place("releases"), (*way, key), f"{what}: {_HELD}")

    def _begins(self, holder: Map, way: Way) -> None:
        """Report transitions that begin a mission, as only the answer to a start does."""
        for key, transition in _transitions_in(holder):
            target = transition.get("target") if isinstance(transition, Map) else transition
            if isinstance(target, Text) and target in self._slots:
                what = f"this begins a mission, which only a start of {self._name} does"
                hint = f"remove it; '{target}.history' goes back to the one that was left"
                self._refuse(target.place, (*way, key), f"{what}: {_ANSWERED}", hint)

    def _on_hold(self, invoke: Map, inherited: Map, way: Way) -> None:
        """Report another effect of holds on an inherited operation."""
        if inherited and "on_hold" in invoke and invoke["on_hold"] != inherited.get("on_hold"):
            what = (
                f"this changes what a hold does to the operation of {self._name}, {inherited.key_place('do')}"
            )
            self._refuse(invoke.key_place("on_hold"), (*way, "invoke", "on_hold"), f"{what}: {_HELD}")

    def _answers(self, on: Map, inherited: Map, way: Way, within: list[Map]) -> None:
        """Report answers to the requests of inherited holds, and to a start."""
        for event in on:
            asked = next((each for each in self._asking if matches(event, each)), None)
            if event in inherited and _is_same(on[event], inherited[event]):
                continue  # it is reported as such
            if asked is not None and _elements(on[event]):
                problem = f"this answers {self._request(asked)}: {_HELD}"
                self._refuse(on.key_place(event), (*way, "on", event), problem)
            elif matches(event, START) and event not in inherited:
                self._start(on, event, way, [_inner(each, "on") for each in within])

    def _request(self, request: str) -> str:
        """Return a request with what it does to an inherited hold."""
        name = self._asking[request]
        does = "engages" if request in self._engaging else "releases"
        return f"{request!r}, which {does} the hold {name!r} of {self._name}, {self._holds.key_place(name)}"

    def _start(self, on: Map, event: str, way: Way, answers: list[Map]) -> None:
        """Report a further answer to a start that is no refusal; a new state may copy an inherited one's."""
        first = next((each for each in answers if START in each), None)
        if all(_refuses(each) or (not answers and way and _copies(each)) for each in _elements(on[event])):
            return
        what, hint = (
            f"this answers a start, which only the states of {self._name} do",
            "or refuse the start here",
        )
        if first is not None:
            what = f"this answers a start, which {self._name} does in {first.key_place(START)}"
        elif not answers and way:
            hint = "refuse the start here, or copy the answers of an inherited state: 'use: STATE'"
        self._refuse(on.key_place(event), (*way, "on", event), f"{what}: {_ANSWERED}", f"remove it, {hint}")


# -- helpers ---------------------------------------------------------------------------------------------


class _Fixed(NamedTuple):
    """The subject of a forbidden override, the reason, and the remedy."""

    what: str
    why: str
    hint: str = "remove it"


@dataclass(frozen=True)
class _Merge:
    """The way in which two values of a key are merged: by name, as one record, or not at all.

    `record` is the model of the record, or of each named one, and `meaning` that of the names. `is_whole`:
    these are transitions or actions, which replace.
    """

    of_names: bool = False
    record: type[Node] | None = None
    meaning: Meaning | None = None
    is_whole: bool = False
    is_transition: bool = False


@cache
def _fields(model: type[Node]) -> Mapping[str, _Merge]:
    """Return by key how the values of a model are merged."""
    return {field.alias or name: _merge_of(field) for name, field in model.model_fields.items()}


def _merge_of(field: Any) -> _Merge:
    nodes = tuple(_nodes(field.annotation))
    is_whole = TransitionNode in nodes or ActionNode in nodes
    return _Merge(
        of_names=get_origin(field.annotation) is dict,
        record=None if is_whole else next(iter(nodes), None),
        meaning=next((each.meaning for each in field.metadata if isinstance(each, Named)), None),
        is_whole=is_whole,
        is_transition=TransitionNode in nodes,
    )


def _nodes(annotation: Any) -> Iterator[type[Node]]:
    """Yield the models that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, Node):
        yield annotation
    for inner in get_args(annotation):
        yield from _nodes(inner)


def _lacks(model: type[Node] | None, new: Any) -> str:
    """Return the required keys that a new record lacks, as a text; '' where it has all."""
    if model is None or not isinstance(new, Map):
        return ""
    if model is PropertyNode:
        return "" if new.keys() - _OF_PROPERTY else "a condition"
    fields = model.model_fields.items()
    missing = [field.alias or name for name, field in fields if field.is_required()]
    return ", ".join(repr(key) for key in missing if key not in new)


def _is_same(new: Any, old: Any) -> bool:
    return bool(new == old) and isinstance(new, bool) == isinstance(old, bool)


def _path(way: Way) -> str:
    return ".".join(map(str, way))


def _inner(holder: Map | None, key: str) -> Map:
    """Return the mapping under a key; an empty one where there is none."""
    found = holder.get(key) if holder is not None else None
    return found if isinstance(found, Map) else map_at(Place("", 1, 1))


def _elements(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (Seq, tuple)) else [value]


def _refuses(transition: Any) -> bool:
    return isinstance(transition, Map) and "refuse" in transition


def _copies(transition: Any) -> bool:
    return isinstance(transition, Map) and "use" in transition


def _requests_of(holds: Map, key: str) -> Iterator[tuple[str, str]]:
    """Yield the requests under a key of holds, the first hold's last; a start has rules of its own."""
    for name, hold in reversed(holds.items()):
        for request in _elements(hold.get(key)) if isinstance(hold, Map) else ():
            if request != START and not str(request).startswith("input."):
                yield str(request), name


def _transitions_in(holder: Map) -> Iterator[tuple[str, Any]]:
    """Yield the transitions that a state or the file writes itself, each with its key."""
    for key, value in holder.items():
        merge = _fields(StateNode).get(key)
        if merge is None or not merge.is_transition:
            continue
        lists = value.values() if merge.of_names and isinstance(value, Map) else (value,)
        yield from ((key, each) for one in lists for each in _elements(one))


def _readers(base: Map) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield the inputs and parameters that holds and answers to a start read, each with its reader.

    And the parameters that the levels of these inputs read.
    """
    found = dict(_read_directly(base))
    yield from found.items()
    for section, name in found:
        if section == "inputs":
            yield from _read_in(_inner(base, "inputs").get(name), f"the input {name!r}")


def _read_directly(base: Map) -> Iterator[tuple[tuple[str, str], str]]:
    for name, hold in _inner(base, "holds").items():
        for text in hold.values() if isinstance(hold, Map) else ():
            yield from _read_in(text, f"the hold {name!r}")
    for name, state in _inner(base, "states").items():
        answers = _inner(state, "on").get(START) if isinstance(state, Map) else None
        for each in _elements(answers):
            if isinstance(each, Map):
                yield from _read_in(each.get("guard"), f"the answer to a start in {name!r}")


def _read_in(condition: Any, reader: str) -> Iterator[tuple[tuple[str, str], str]]:
    for root, name in _READ.findall(str(condition)):
        yield (_SECTIONS[root], name), reader


def _words_in(value: Any) -> Iterator[str]:
    """Yield the words of all values, not those of keys."""
    if isinstance(value, Map):
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            yield from _words_in(each)
    elif isinstance(value, str):
        yield from re.findall(r"\w+", value)
