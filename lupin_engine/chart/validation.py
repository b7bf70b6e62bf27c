"""Validates a file as a document: its kind, its shape, and a finding for each unknown key."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from lupin_engine.chart.documents import KINDS, FileNode
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node, keys_of, show
from lupin_engine.chart.sequences import write_out
from lupin_engine.chart.source import Map, Seq
from lupin_engine.errors import Diagnostic, Place, meant

_M = TypeVar("_M", bound=Node)
_D = TypeVar("_D", bound=FileNode)

#: How often a file is read again without what was wrong in it.
MAX_PRUNINGS = 8

#: Steps to something in a file: keys, and numbers in lists.
Way = tuple[str | int, ...]
#: Keys under which files declare what is named elsewhere.
_DECLARING = frozenset(
    {
        "states",
        "params",
        "context",
        "inputs",
        "levels",
        "codes",
        "holds",
        "request",
        "fields",
        "choices",
        "types",
    }
)
#: Rules that find something missing in a state, or what is said there of its transitions.
_OF_A_STATE = frozenset(
    {"unhandled-outcome", "never-wins", "both-can-win", "missing-argument", "no-initial", "no-deadline"}
)
#: Rules that look for what a file declares.
_OF_NAMES = ("unknown-", "undeclared-", "missing-itinerary")

#: Every key that says what kind of file it stands in.
KEYS_OF_KINDS = (*KINDS, "binding")


def read_document(
    raw: Map, model: type[_D], findings: Findings, left_out: list[Way] | None = None
) -> _D | None:
    """Validate a file against its model; None after findings that leave it unusable.

    Parts with a wrong shape are added to `left_out`.
    """
    kind = next(word for word, known in KINDS.items() if known is model)
    if not is_kind(raw, kind, findings):
        return None
    if kind != "part":
        want_defaults(raw, findings)
    write_out(raw, findings)
    return validate(raw, model, findings, left_out)


def follows(found: Diagnostic, left_out: Iterable[Way]) -> bool:
    """Say whether a finding may only follow from parts that were left out of the file."""
    return any(_follows(found, *map(str, way)) for way in left_out)


def _follows(found: Diagnostic, *way: str) -> bool:
    holder, last = way[:-1], way[-1]
    if found.rule.startswith("unused-"):
        return True
    if found.rule.startswith(_OF_NAMES):
        if last in _DECLARING or (last == "itinerary" and found.rule == "missing-itinerary"):
            return True
        if holder and holder[-1] in _DECLARING and re.search(rf"\b{re.escape(last)}\b", found.problem):
            return True
    if last == "ask" and found.rule == "unknown-event" and "'answer." in found.problem:
        return True
    if found.rule == "missing-key" and found.path == ".".join(holder):
        return True
    around = ".".join(name for key, name in pairwise(way) if key == "states")
    return found.rule in _OF_A_STATE and f".{around}." in f".{found.path}."


def want_defaults(raw: Map, findings: Findings) -> None:
    """Report the parameters without a default: only the user of a part can give one."""
    params = raw.get("params")
    for name, written in params.items() if isinstance(params, Map) else ():
        if isinstance(written, Map) and "default" not in written:
            problem, hint = "the key 'default' is missing", "write 'default: ...'"
            findings.add(written.place, "missing-key", f"params.{name}", problem, hint)


def is_kind(raw: Map, kind: str, findings: Findings) -> bool:
    """Say whether a file declares a kind; a finding otherwise."""
    if kind in raw:
        return True
    other = next((word for word in KEYS_OF_KINDS if word in raw), None)
    what = f"this is a {other}" if other else "the file does not say what it is"
    place = raw.key_place(other) if other else raw.place
    findings.add(place, "wrong-shape", "", f"expected a {kind}, but {what}", f"begin with '{kind}: NAME'")
    return False


def validate(raw: Map, model: type[_M], findings: Findings, left_out: list[Way] | None = None) -> _M | None:
    """Validate the mapping of a whole file as `model`; None after findings that leave it unusable.

    Parts with a wrong shape are left out like unknown keys, and the rest is read; `left_out` gets them.
    """
    pruned: list[Way] = []
    for _ in range(MAX_PRUNINGS):
        try:
            return model.model_validate(raw)
        except ValidationError as error:
            found = [(details, _way(raw, details)) for details in error.errors(include_url=False)]
        for details, way in found:
            # What holds something that was left out may be wrong for want of that.
            if not any(len(inside) > len(way) and inside[: len(way)] == way for inside in pruned):
                _report(raw, details, findings)
        if left_out is not None:
            left_out += [way for details, way in found if details["type"] != "extra_forbidden"]
        pruned += dict.fromkeys(way for _, way in found)
        backwards = list(dict.fromkeys(way for _, way in reversed(found)))
        for way in sorted(backwards, key=len, reverse=True):  # what is inside before what is around it
            _prune(raw, way)
    return None


def _way(raw: Map, details: ErrorDetails) -> Way:
    """Return the steps of an error's path that there are in the file."""
    found: Any = raw
    way: list[str | int] = []
    for step in details["loc"]:
        key = str(step) if isinstance(found, Map) else step
        if _has(found, key):
            way.append(key)
            found = found[key]
    return tuple(way)


def _prune(raw: Map, way: Way) -> None:
    """Drop a part that was reported as wrong, so that the rest of the file can still be read.

    What several aliases stand for is dropped for all of them at once.
    """
    holder: Any = raw
    for step in way[:-1]:
        holder = holder[step] if _has(holder, step) else None
    if not way or not _has(holder, way[-1]):
        return
    if isinstance(holder, Seq):
        holder.starts.pop(int(way[-1]))
    del holder[way[-1]]


def _has(holder: Any, step: str | int) -> bool:
    """Say whether there is such a key in a mapping, or such a number in a list."""
    if isinstance(holder, Map):
        return step in holder
    return isinstance(holder, Seq) and isinstance(step, int) and step < len(holder)


def _report(raw: Map, details: ErrorDetails, findings: Findings) -> None:
    """Turn one of pydantic's errors into a finding at the deepest place that its path still meets."""
    found: Any = raw
    place, trail, missing = raw.place, [], ""
    for step in details["loc"]:
        name = str(step)
        if isinstance(found, Map) and name in found:
            place, missing = found.value_place(name), ""
            found, last = found[name], found.key_place(name)
            trail.append(name)
        elif isinstance(found, Seq) and isinstance(step, int) and step < len(found):
            place, missing = found.place_of(step), ""
            found, last = found[step], place
            trail.append(name)
        else:
            missing = name
    path = ".".join(trail)
    kind = details["type"]
    if kind == "extra_forbidden":
        _unknown_key(raw, trail, last, findings)
    elif kind == "missing":
        hint = f"write '{missing}: ...'"
        findings.add(place, "missing-key", path, f"the key {missing!r} is missing", hint)
    elif kind == "wrong-shape":
        problem, _, hint = details["msg"].partition("; ")
        findings.add(place, "wrong-shape", path, problem, hint)
    else:
        findings.add(place, "wrong-shape", path, *_expected(details, found))


def _unknown_key(raw: Map, trail: list[str], place: Place, findings: Findings) -> None:
    key, path = trail[-1], ".".join(trail[:-1])
    holder: Any = raw
    for name in trail[:-1]:
        holder = holder[int(name)] if isinstance(holder, Seq) else holder[name]
    if holder.model and key in holder.model.ELSEWHERE:
        findings.add(place, "wrong-shape", path, *holder.model.ELSEWHERE[key])
        return
    known = keys_of(holder.model) if holder.model else ()
    if holder[key] is None and " " in key:
        hint = "if it belongs to the text before it, quote that text: an unquoted comma begins a new key"
        findings.add(place, "unknown-key", path, f"unknown key {key!r}", hint)
        return
    findings.unknown(place, "unknown-key", path, "key", key, known)


_SHAPES: Mapping[str, str] = {
    "model_type": "a mapping",
    "dict_type": "a mapping",
    "list_type": "a list",
    "string_type": "text",
    "bool_type": "true or false",
}


#: What a mapping looks like that authors write without its braces, by its key.
_MAPPINGS: Mapping[str, str] = {
    "after": "{DURATION: STATE}",
    "every": "{DURATION: {do: ACTION}}",
    "at": '{"06:30": STATE}',
    "on": "{EVENT: STATE}",
}


def _expected(details: ErrorDetails, found: Any) -> tuple[str, str]:
    """Return problem and hint for a value of the wrong shape."""
    kind = details["type"]
    if kind == "literal_error":
        allowed = str(details["ctx"]["expected"])
        hint = meant(found, re.findall(r"'([^']+)'", allowed)) if isinstance(found, str) else ""
        return f"expected {allowed}, got {show(found)}", hint
    if kind == "dict_type" and details["loc"][-1] in _MAPPINGS:
        return f"expected {_MAPPINGS[str(details['loc'][-1])]}, got {show(found)}", ""
    return f"expected {_SHAPES.get(kind) or details['msg']}, got {show(found)}", ""
