"""The collection of findings of all steps of loading, and the rules that they name.

A step reports and continues: it returns the usable part of its result (or None), and raises nothing for a
mistake of the author; only after `MAX_FINDINGS` loading ends (see `collected`). `RULES` is the whole list of
rule ids, each with its purpose; a test holds a broken mission for every one of them, and docs/rules.md shows
it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TypeVar

from lupin_engine.errors import Diagnostic, Place, Severity, nearest

#: After so many findings nobody reads on, and each costs time: names are compared with all that are allowed.
MAX_FINDINGS = 1000

_T = TypeVar("_T")

_PROVEN = "What a proof looks for"
#: By subject: every rule with what it protects.
SUBJECTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "Files and their shape": {
            "no-file": "a file that the mission needs is there",
            "wrong-yaml": "the file is one YAML document of plain mappings, lists and scalars",
            "too-large": "size, depth, aliases and expanded states stay within bounds",
            "duplicate-key": "a key stands once in a mapping",
            "unknown-key": "a key is one of the language",
            "unknown-profile": "the profile of a lifecycle is installed",
            "unknown-lifecycle": "the lifecycle that one extends is shipped, and extends none itself",
            "not-overridable": "what stops a robot and what answers a start are those of the shipped one",
            "overrides-nothing": "what a lifecycle overrides is there, and is changed by it",
            "missing-key": "what cannot be guessed is written",
            "wrong-shape": "a value has the shape that its key asks for",
            "bad-name": "names are made so that they can be found in a path or an expression",
            "conflicting-definition": "a name that several files declare means the same in all of them",
            "not-allowed": "what a binding talks to is a plugin's, or the robot's lupin.yaml allows it",
        },
        "Types, units and expressions": {
            "unknown-type": "a type is declared, built in or a plugin's; that of a service is installed",
            "wrong-type": "a value or operand has the type that is asked for",
            "wrong-unit": "quantities of different dimensions are not mixed",
            "no-unit": "a duration, length or angle says its unit",
            "out-of-range": "a default lies within its minimum and maximum, and a question leaves time",
            "bad-expression": "an expression belongs to the safe subset",
            "partial-expression": "an expression is the whole value, not a piece of a text",
            "unknown-name": "an expression reads what is declared and present there",
            "unknown-parameter": "a parameter is declared in the file, the lifecycle or a plugin",
            "unknown-function": "a function is built in or a plugin's",
            "unknown-input": "a live value, and what is looked for, is read only where it is known",
            "unbounded": "a list grows no further than it says, and an expression takes a few steps",
        },
        "Names of states, events, operations and the rest": {
            "unknown-state": "a target or in_state names a state in scope",
            "shadowed-state": "a target means the same to the reader as to the engine",
            "unknown-event": "an event can arrive",
            "unknown-operation": "an invocation names a plugin's operation",
            "unknown-action": "an action is built in or a plugin's",
            "unknown-argument": "an argument is one that the operation, action or function has",
            "missing-argument": "an argument without a default is given",
            "different-fields": "an event or the end of a state always carries the same fields",
            "unknown-value": "an input names a live value of a plugin",
            "unknown-part": "what a state uses is a file in the folder of parts, or a mission beside",
            "part-loop": "a part or mission does not contain itself",
            "unknown-hold": "a hold is declared in the lifecycle",
            "unknown-property": "a property that is built in, or not meant, is one that there is",
            "undeclared-code": "every code that can reach last_error has a label and a severity",
            "missing-itinerary": "what walks an itinerary stands in a state that has one",
        },
        "Which transition is taken": {
            "unhandled-outcome": "every end of an operation or state leads somewhere, with every code",
            "never-happens": "an ending that is handled can occur",
            "never-wins": "a transition can be taken: its guard may be true, and none before it always is",
            "both-can-win": "what is done does not depend on the order of keys or regions",
            "releases-level-hold": "a hold that a level engages is released by a person, not by a transition",
            "held-for-ever": "a mission does not refuse, whatever happens, what alone releases a hold",
            "level-with-guard": "a hold that a level engages has no guard: the level alone decides",
            "level-without-target": "a transition on a level leaves the state, or it would be taken for ever",
        },
        "Ways through the chart": {
            "no-initial": "entering a state never needs a guess",
            "no-deadline": "a state that waits for the world does not wait for ever",
            "not-updated": "new arguments of a running operation reach its server, and can come",
            "unreachable-state": "every state can be entered",
            "dead-end": "from every state an end can be reached: of the mission, or FAULT",
            "always-loop": "a chart comes to rest: no circle of 'always' is taken for ever",
            "never-breaks": "a property forbids something: some run would break it",
        },
        "Itineraries": {
            "double-close": "a visit is closed once, and nothing else publishes its target",
            "repeated-target": "targets of one itinerary that differ have different ids",
            "open-visit": "an itinerary goes on from a visit that is closed",
            "no-target": "a target is read only where the itinerary has one",
            "begins-anew": "an itinerary is begun anew on purpose, not by what only wants to go on",
            "untold-rest": "what ends an itinerary early tells of the targets that are left",
        },
        "Parallel states": {
            "shared-resource": "operations that are active together do not wait for each other unnoticed",
            "shared-variable": "parts that are active together report into variables of their own",
            "region-leak": "a region of a parallel state is left together with the whole state, on purpose",
        },
        _PROVEN: {
            "broken-property": "a property holds in everything that can happen, as far as lupin prove looks",
            "never-applies": "a property concerns something that can happen",
            "never-reached": "in what can happen every state is entered and every transition is taken",
            "not-proven": "a proof comes to its end in the time that it is given",
            "grows-without-end": "what a mission remembers has a bound, so that a proof comes to its end",
        },
        "What nobody uses": {
            "unheard-event": "an event that is raised is listened to",
            "unused-part": "a part is used by a mission",
            "unused-answer": "where a warning is accepted, there is that warning",
            "unused-parameter": "a parameter that can be set does something",
            "unused-code": "a code that is declared can be reported",
            "unused-input": "an input that is declared is read",
            "unused-variable": "a variable that is kept is read",
            "never-set": "a variable that is read can have another value than its default",
            "one-way-switch": "what an action switches is switched back somewhere",
            "unused-field": "a field that a request carries is read",
            "unused-result": "what the end of a mission gives is read, by one that uses it",
        },
    }
)
RULES: Mapping[str, str] = MappingProxyType(
    {rule: protects for rules in SUBJECTS.values() for rule, protects in rules.items()}
)


class Findings:
    """Collects diagnostics, each once: a part that is used twice reports its mistakes at its first use.

    A rule that is not in `RULES` is a KeyError.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Place, str, str], Diagnostic] = {}

    def add(self, place: Place, rule: str, path: str, problem: str, hint: str = "") -> None:
        """Report an error."""
        self._put(Diagnostic(place, rule, path, problem, hint))

    def warn(self, place: Place, rule: str, path: str, problem: str, hint: str = "") -> None:
        """Report a probable mistake that does not prevent loading."""
        self._put(Diagnostic(place, rule, path, problem, hint, Severity.WARN))

    def unknown(
        self, place: Place, rule: str, path: str, what: str, name: str, allowed: Iterable[str]
    ) -> None:
        """Report a name that is none of the `allowed`, with the nearest spelling."""
        self.add(place, rule, path, f"unknown {what} {name!r}", nearest(name, allowed))

    def extend(self, found: Iterable[Diagnostic]) -> None:
        """Take over findings made elsewhere."""
        for diagnostic in found:
            self._put(diagnostic)

    def _put(self, diagnostic: Diagnostic) -> None:
        if diagnostic.rule not in RULES:
            raise KeyError(f"rule {diagnostic.rule!r} is not in RULES")
        self._found.setdefault((diagnostic.place, diagnostic.rule, diagnostic.problem), diagnostic)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._found)

    @property
    def all(self) -> tuple[Diagnostic, ...]:
        """Everything found, in file order."""
        return tuple(sorted(self._found.values(), key=lambda d: (d.place, d.rule, d.problem)))

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        """The errors, which make the chart unusable, in file order."""
        return tuple(d for d in self.all if d.severity is Severity.ERROR)


class _TooManyFindings(Exception):
    """There are more than `MAX_FINDINGS` findings; the last of them says so."""


class _LimitedFindings(Findings):
    """Findings, until there are too many."""

    def add(self, place: Place, rule: str, path: str, problem: str, hint: str = "") -> None:
        """Report an error; after `MAX_FINDINGS` a last one, and raise _TooManyFindings."""
        super().add(place, rule, path, problem, hint)
        if self.count > MAX_FINDINGS:
            problem = f"more than {MAX_FINDINGS} findings, the rest is not told"
            super().add(place, "too-large", "", problem, "mend these first")
            raise _TooManyFindings


def collected(
    work: Callable[[Findings], _T | None], known: Iterable[Diagnostic] = ()
) -> tuple[_T | None, tuple[Diagnostic, ...]]:
    """Run `work` with findings; return its result, and all findings with those `known` before.

    The result is None when there are too many.
    """
    findings = _LimitedFindings()
    findings.extend(known)
    try:
        return work(findings), findings.all
    except _TooManyFindings:
        return None, findings.all


#: A comment that accepts a warning: at the end of its line, or on the lines just above it.
_ANSWER = re.compile(r"#\s*accept\s+([\w-]+)(?:\s*:\s*(.*\S))?")


def accepted(one: Diagnostic, lines: Sequence[str]) -> Diagnostic:
    """Return a warning as a note with the reason, where its file, which has these lines, accepts it."""
    answer = lines[_answer_to(one, lines) - 1] if _answer_to(one, lines) else ""
    reason = next((match[2] for match in _ANSWER.finditer(answer) if match[1] == one.rule), "")
    return replace(one, severity=Severity.INFO, hint=f"accepted: {reason}") if reason else one


def answered(
    found: Iterable[Diagnostic],
    files: Mapping[str, Sequence[str]] = MappingProxyType({}),
    shared: Container[str] = (),
) -> tuple[Diagnostic, ...]:
    """Return findings in file order, each once; warnings that their file accepts are notes with the reason.

    `# accept RULE: REASON` stands on the line of a warning or just above it. One that accepts nothing is a
    warning itself, except after errors, when not every rule has run, for a rule of proofs, and in a file
    `shared` by missions of which not all may be loaded.
    """
    findings = Findings()
    findings.extend(found)
    found = findings.all
    result = [accepted(one, files.get(one.place.file, ())) for one in found]
    broken = any(one.severity is Severity.ERROR for one in found)
    used = {(one.place.file, _answer_to(one, files.get(one.place.file, ())), one.rule) for one in found}
    for file, lines in files.items():
        for place, rule, reason in _answers(file, lines):
            problem, hint = f"there is no warning {rule!r} here", "remove the comment"
            if rule not in RULES:
                problem, hint = f"unknown rule {rule!r}", nearest(rule, RULES)
            elif not reason:
                problem, hint = "this gives no reason", f"write '# accept {rule}: REASON'"
            elif broken or file in shared or rule in SUBJECTS[_PROVEN] or (file, place.line, rule) in used:
                continue
            result.append(warning(place, "unused-answer", "", problem, hint))
    return tuple(sorted(result, key=lambda d: (d.place, d.rule, d.problem)))


def _answers(file: str, lines: Sequence[str]) -> Iterator[tuple[Place, str, str | None]]:
    """Yield every comment that accepts a warning: its place, the rule, and the reason or None without one."""
    for number, line in enumerate(lines, start=1):
        for match in _ANSWER.finditer(line):
            yield Place(file, number, match.start() + 1), match[1], match[2]


def _answer_to(one: Diagnostic, lines: Sequence[str]) -> int:
    """Return the number of the line that answers a warning; 0 where none does."""
    number = one.place.line if one.severity is Severity.WARN else 0
    while 1 <= number <= len(lines):
        if any(match[1] == one.rule for match in _ANSWER.finditer(lines[number - 1])):
            return number
        number -= 1
        if number and not lines[number - 1].lstrip().startswith("#"):
            break
    return 0


def warning(place: Place, rule: str, path: str, problem: str, hint: str = "") -> Diagnostic:
    """Return a finding that is probably a mistake but can be loaded."""
    return Diagnostic(place, rule, path, problem, hint, Severity.WARN)
