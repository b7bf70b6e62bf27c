"""Write the reference pages from the source: the rules of the checker, the language, what plugins offer.

    .venv/bin/python tools/reference.py rules > docs/rules.md
    .venv/bin/python tools/reference.py language > docs/language.md
    .venv/bin/python tools/reference.py catalog > docs/catalog.md

A page is a function of what stands in the checkout, so a test can tell when it is out of date. The rules come
with the smallest of the charts in tests/charts/broken that breaks them, the words with the examples in
docs/examples (one file a model, named like it: a state's content, or a whole file).
"""

from __future__ import annotations

import inspect
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import WithJsonSchema
from pydantic.fields import FieldInfo

from lupin_engine.bindings import file as binding_file
from lupin_engine.bindings.file import BindingNode
from lupin_engine.chart.compose.actions import builtin_actions
from lupin_engine.chart.documents import (
    KINDS,
    ActionNode,
    Bound,
    Condition,
    StateNode,
    TransitionNode,
    Written,
)
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS
from lupin_engine.chart.findings import SUBJECTS
from lupin_engine.chart.nodes import Node
from lupin_engine.plugin.describe import Entry, Section, sections
from lupin_engine.plugin.discovery import entry_points
from lupin_engine.plugin.registry import import_plugin
from lupin_engine.plugin.types import BUILTIN_TYPES, UNITS
from lupin_greenhouse.profile import PROFILE

ROOT = Path(__file__).resolve().parents[1]
CHARTS = ROOT / "tests" / "charts"
BROKEN = CHARTS / "broken"
EXAMPLES = ROOT / "docs" / "examples"
BINDING = ROOT / "docs" / "tutorial" / "bindings" / "photo_arm.yaml"

#: More lines of one rule than this say nothing new.
MAX_LINES = 6

# -- the rules --------------------------------------------------------------------------------------------

RULES_HEAD = """\
# What the checker finds

`lupin check` reads a mission with its lifecycle and its parts and tells everything that is wrong with it at
once, without a robot, ROS or a plugin's node:

```text
missions/inspection.yaml:29:16: error: MISSION.InspectionMission.PREPARE.LOCALIZING.on_done: no state is \
called 'INSPECTNG' here; did you mean 'INSPECTING'? [unknown-state]
```

That is: file, line and column; whether it is an error or a warning; where in the chart; what is wrong; what
to do about it, with what is allowed or the nearest spelling; and in brackets the rule, which you find below.
A mission with an error is not loaded. A warning is probably a mistake, and the mission can be run all the
same. One that you mean to keep is accepted in its file, on its line or just above it, by a comment with the
reason; it is listed as a note then, also for `--strict`:

```yaml
# accept shared-resource: the second drive may wait for the first
```

The examples are the tests of the checker (`tests/charts/broken`, each beside its exact text). The missions
among them are checked in a small lifecycle (`tests/charts/mini`), which is where states, holds and codes come
from that they do not declare themselves; of an example that breaks several rules only the one in question is
shown.
"""


def rules() -> Iterator[str]:
    """Yield the page of the rules, line by line."""
    yield from (*RULES_HEAD.splitlines(), "")
    for subject, found in SUBJECTS.items():
        yield from (f"## {subject}", "")
        for rule in sorted(found):
            yield from (f"### {rule}", "", f"{_sentence(found[rule])} *{_severities(rule)}*", "")
            yield from _broken(rule)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _told(rule: str, case: Path) -> list[str]:
    """Return what the checker prints of a rule for a broken chart."""
    lines = case.with_suffix(".txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.endswith(f"[{rule}]")]


def _cases() -> list[Path]:
    return sorted(path.with_suffix("") for path in BROKEN.glob("*.txt"))


def _severities(rule: str) -> str:
    found = {line.split(": ")[1] for case in _cases() for line in _told(rule, case)}
    return " or ".join(sorted(found))


def _broken(rule: str) -> Iterator[str]:
    """Yield the charts that show a rule: those named like it, else the one that says least besides."""
    cases = [case for case in _cases() if _told(rule, case)]
    named = [case for case in cases if case.name.startswith(rule.replace("-", "_"))]
    for case in named or [min(cases, key=lambda case: _size(rule, case))]:
        lines = _told(rule, case)
        file = CHARTS / lines[0].partition(":")[0]
        if file.is_file():
            yield from _block("yaml", file.read_text(encoding="utf-8"))
        else:
            names = sorted(path.name for path in file.parent.iterdir())
            yield f"A folder with {' and '.join(f'`{name}`' for name in names)} and no `{file.name}`:"
        yield ""
        yield from _block("text", "\n".join(lines[:MAX_LINES]))
        yield ""


def _size(rule: str, case: Path) -> tuple[int, int, str]:
    """Return how much a broken chart says that has nothing to do with a rule, and how long it is."""
    others = len(case.with_suffix(".txt").read_text(encoding="utf-8").splitlines()) - len(_told(rule, case))
    file = case.with_suffix(".yaml")
    return others, len(file.read_text(encoding="utf-8")) if file.is_file() else 0, case.name


def _block(language: str, text: str) -> Iterator[str]:
    yield f"```{language}"
    yield from text.strip("\n").splitlines()
    yield "```"


# -- the language -----------------------------------------------------------------------------------------

LANGUAGE_HEAD = """\
# The language of missions

A mission is a statechart in YAML. There are three kinds of file, told apart by their first key: a *lifecycle*
is what all missions share (starting up, pausing, driving home), a *mission* is what a robot is asked to do
and stands in the lifecycle's slot, a *part* is a piece that missions use, as they may use another mission.
`lifecycle.yaml` stands beside the missions, the parts in the folder `parts` there. What a mission can do
comes from plugins; a service that no plugin calls is connected by a [binding](#bindings), a fourth kind of
file. The shipped ones in `missions/` are the best introduction; this page is for looking things up. What
`lupin check` says about a file is explained in [rules.md](rules.md).

## How a chart runs

- A state is active or not. With a state one of its children is active, with a parallel one all of them
  (its *regions*). Targets are looked for in the nearest state around that has a child of that name, and
  further down with dots (`RETURNING.DOCKED`); the states of a part that a state uses come last.
- An event is offered to the innermost active states first, then outwards; within a state in the order
  written. The first transition whose guard is true is taken. One without a target runs its actions and
  leaves nothing.
- Taking a transition leaves states (`exit`), runs its actions (`do`) and enters states (`entry`). Then
  whatever is enabled without an event follows (`always`, levels), then what was raised, until nothing more
  happens. Only then operations begin. No time passes meanwhile.
- `event` has the fields of the event that is dealt with. It stays visible in what follows at once without
  an event: in the `entry` and the operation of what is entered, and in an `always` that is taken in the
  same step. A field that one of the ways to an expression does not bring is an error of the checker; keep
  it in a variable where it is seen.
- An operation lives as long as its state: leaving the state cancels it. Its end is `on_done` or `on_error`.
  An error that nobody handles, and an expression or action that fails, leads to the lifecycle's FAULT
  (`lupin simulate` shows that as `error.execution`).
- What a hold or leaving the state ended does not count as a try of `retry`. The share of `jitter` is drawn
  from a seed, the mission and the attempt: the same inputs give the same pauses.
- A *hold* (a pause, an emergency stop) suspends the whole chart: what moves the robot is cancelled, clocks
  stand still, answers wait. After the release the chart first comes to rest; then what was cancelled begins
  again in the states that are still active, or ends as its `on_hold` says. A request is answered at once all
  the same: a transition that says `during` or `releases` is taken, anything else refused.
- A mission begins when its request is accepted: its variables and those of its parts have their defaults,
  its `entry` runs, its itineraries, budgets and history are new. Coming back by history, as from the dock,
  is no beginning. Variables of the lifecycle keep their values from mission to mission. While an invariant
  does not hold no mission begins.
- *Properties* are for proofs, campaigns and tests: they say what is true of every run, and the robot does not
  watch them. What must stop the robot is an invariant.
- The itineraries of one mission are counted together, in what is published and in its summary; one that is
  begun anew adds its targets again. The targets of an itinerary that depends on the request alone are known
  from the start. `itinerary.close_rest` closes the itinerary around, else those inside the state that it
  is written in, and in the lifecycle all of the mission, however early that ends: a target that several of
  them have is told once, as long as none of them is begun.
- A *part* that a mission uses twice has its variables once: both uses read and set the same ones, and each
  goes on with what the other has left, also at the same time in a `parallel` state. To begin with a value of
  its own, a use sets it in its `entry`. Parameters are by use: `with` gives each its own.
- A *mission as a part*: `use: inspection` stands for the states of `inspection.yaml` beside the file, and
  `with` gives fields of its request; one that is not given has its default. It is what it is by itself: it
  reads its own request, and names its own states and those of the lifecycle, none of the mission around.
  Whenever the state is entered, but not by history, it begins: its request, which is an error where the
  mission would refuse it, its variables and those of its parts, its budgets and its `entry`. Its end is
  `on_done` of the state, with the `result` of that end. What leads to a state of the lifecycle leads the
  whole mission there; a history comes back into the mission that was left, however deep it stands. What is
  reported and observed is of the mission that was started, and `since: mission` counts from its start.
- A *code* is why something happened, with a detail for people. Each time that one is reported is an event: in
  the log, the live view and the record of the run, with the target that it is about. Of all that a mission
  has reported, the newest of the worst is published with its label, as `last_error`. A refused request is
  answered with a code, which reports nothing.
- A live value is *unknown* before its first report, or when that is too old. A guard that reads it is then
  false, so ask with `known(...)`. What a guard has asked counts for the `do` of its transition.

## How to read the tables

*Value* is something written out (`30 s`, `home`, `[1, 2]`) or an expression in `${ }`, *condition* is an
expression without `${ }`, and *one or more* means that a list of one may be written without the list. A key
in **bold** must be written.
"""

ACTIONS_HEAD = """\
## Actions

Under `entry`, `exit` and `do`: a name, or a mapping of one name to its arguments. A plugin's are called
`PLUGIN.ACTION`.
"""
EXPRESSIONS_HEAD = """\
## Expressions

A safe piece of Python, checked when the file is read: `and`, `or`, `not`, comparisons and `in`,
`+ - * / // %` of numbers, `x if c else y`, fields of records, elements of lists, texts, numbers, `true`,
`false`. A number with a unit is written as a text where it meets another (`param.patience > '5 s'`). Lists
are not joined: a variable is filled by `add`, an order is a number for each element. A list is gone
through by `[tag.id for tag in request.tags if tag.x > '1 m']`, with one loop and none inside it; in `find`
and `sorted` the element is called `t`. There are no methods. An expression that could take long is refused: a
list counts with its `max`, one that has none with 1000 elements, and going through a longer one is an error.

What a plugin tells by names is read by them, in the unit that its catalog says, such as
`event.reading['temperature']`. A name that was not told is unknown, as a live value is before its first
report: a guard that reads it is false, and an action is an error, so ask with `known(...)`.

Where a text is wanted, expressions may stand in it: `tag ${ target.id } after ${ param.patience:.1f min }`.
Each is a text, a number with its unit, a yes or no, or a list of those, which is joined with commas. Behind a
colon stand the digits of a number (`.1f`), another unit of its dimension (`min`), or both.

What can be read, besides variables of the context and the element of a `for_each`, by their names:
"""
TIME_OF_DAY_HEAD = """\
## Time of day

A mission reads the robot's clock in the time zone of the parameter `time_zone`, an IANA name such as
`Europe/Amsterdam`. Where nobody sets it, that is UTC, so that a mission does the same on every computer.
What stands under `at` happens each time that this clock comes to a time of day while the state is active. A
time at which the guard is false is dealt with for that day.
"""
#: What becomes of a time of day where it is not simply come to.
TIMES = (
    ("the state is entered at that time or later", "tomorrow is the first day"),
    (
        "a hold is engaged",
        "the clock goes on: what it comes to waits for the release and happens once then, or at its time "
        "where the transition says `during`",
    ),
    (
        "the clock is set forward over the time",
        "it happens at once, once for all the days that are left out",
    ),
    (
        "the clock is set back",
        "a state does not deal with a time twice on one date of one mission, also when it was left and "
        "entered again",
    ),
    ("the summer leaves the time out (02:30)", "it happens when the clock leaps over it, at 03:00"),
    ("the winter brings the time twice", "the first counts"),
)
TIME_OF_DAY_REST = """\
That the clock was set is noted in the step, which the log, the record and the story of the run show. A
computed time (`"${ param.end }"`, of type `time_of_day`) is looked at when the state is entered and then
every day.

`clock.today` and `clock.time` are texts that have an order: `clock.time >= '22:00' or clock.time < '06:00'`.
That time goes by is no event: a guard of an `always` that reads the clock is looked at when something else
happens. With `use_sim_time` the clock is the simulated time, counted from 1970 in UTC. A simulation begins on
2026-01-01 at 00:00, or as [its scenario](testing-missions.md) says, never today.
"""
TYPES_HEAD = """\
## Types and units

Types of parameters, variables and request fields; any of them may follow `list of` or `set of`. A set holds
each element once, in the order in which they came. Plugins add their own types.
"""
UNITS_HEAD = """\
A number that has a dimension is written with one of its units, and declared as `type: number` with `unit`.
Only numbers of one dimension are added or compared; a product or a quotient has the dimension that follows:
`given / '2 l/min'` is a duration where `given` is an amount of water. Temperatures are kept in °C, so that
differences are right and ratios mean nothing.
"""

#: How the shape of a key that may be computed is told.
_COMPUTED = {"Written": "value", "Condition": "condition", "Bound": "number, with its unit"}
#: What expressions read, with what it is.
ROOT_TEXTS: Mapping[str, str] = {
    "param": "parameters, as `param.NAME`",
    "request": "fields of the request that started the mission, as `request.NAME`",
    "input": "live values, as `input.NAME`; with levels `input.NAME.value` and `input.NAME.LEVEL`",
    "event": "what the event carries, as `event.FIELD`; in `on_done` the result",
    "error": "in `on_error`: `error.code`, `error.detail`; `error.result` of an operation that was cut short",
    "target": "the element of the itinerary that is being visited",
    "clock": "the robot's clock ([Time of day](#time-of-day)): `clock.today`, such as '2026-11-22', and "
    "`clock.time`, such as '06:30'",
    "this_step": "in properties, the step that was made: the request that it `.accepted` or `.refused` "
    "('' for none) and `.because` of which code; the holds that it `.released`; the operations that it has "
    "`.begun`, and whose end it took as `.succeeded` or `.failed`; those that it has `.given_up`: "
    "they failed, or their state was left before they succeeded; those that it has `.bypassed`: their "
    "success leads to a state that was entered from elsewhere; the `.codes` that it reports; whether "
    "something is `.moving` after it, and whether the robot shows that it is `.waiting`: held, paused, "
    "asking, or without a mission",
    "itinerary": "`itinerary.open` (the visit has no outcome yet), `.remaining` (targets after this one), "
    "`.total`, `.closed`, `.sweep` (1 in the first)",
}
CALL_TEXTS: Mapping[str, str] = {
    "len": "`len(list or text)`",
    "min": "`min(list)` or `min(a, b, ...)`",
    "max": "`max(list)` or `max(a, b, ...)`",
    "sum": "`sum(list of numbers)`: what they come to; of none 0",
    "abs": "`abs(number)`",
    "round": "`round(number)`, or `round(number, 2)` for two digits",
    "any": "`any(list of yes or no)`: one of them is true",
    "all": "`all(list of yes or no)`: none of them is false",
    "first": "`first(list, default)`: the first element, or the default when there is none",
    "find": "`find(list, t.id == target.id)`: the first element `t` for which that is true; without, unknown",
    "sorted": "`sorted(list, t.x)`: the elements by a number or a text of each, the smallest first",
    "known": "`known(input.NAME)`: a report, not too old; also of `find(...)`, `error.result`, names",
    "held": "`held(HOLD)`: the hold is engaged; in properties also `restarted` and `breached`",
    "in_state": "`in_state('NAME')`: a state of that name is active",
    "was_in_state": "`was_in_state('NAME')`, in properties: such a state was active before the step",
}
ACTION_TEXTS: Mapping[str, str] = {
    "set": "write variables of the context: `set: {NAME: VALUE, ...}`",
    "add": "put something into lists and sets that have a `max`: `add: {NAME: VALUE, ...}`; into one "
    "that is full is an error, a set that has it already stays as it is",
    "remove": "take something out of lists and sets, wherever it stands there: `remove: {NAME: VALUE, ...}`",
    "raise": "tell the whole chart of an event: see [Raise](#raise)",
    "if": "carry out `then` where the guard is true, else `else`: see [If](#if)",
    "itinerary.advance": "go on to the next target; refused while the visit is open",
    "itinerary.close": "give the visit its outcome, once, and publish it; `detail` goes out as the reason of "
    "what is not OK, and with OK stays in the summary of the run",
    "itinerary.close_rest": "close every visit of this sweep that is still open; a state that a budget or an "
    "event ends tells nothing of them without it",
    "report.clear": "forget the code that was reported last",
    "report.note": "say something in the log and in the story of the run",
    "report.summary": "publish what became of every target",
    "publish.reading": "publish a reading that belongs to no visit",
}
BINDINGS_HEAD = """\
## Bindings

What somebody offers over ROS becomes a plugin by a file in the folder `bindings` beside the missions,
without Python. A service or an action is an operation (`BINDING.OPERATION`), a topic that is listened to a
live value or an event (`BINDING.EVENT`), a message that is published an action (`BINDING.ACTION`). All that
`lupin check`, the simulation and your editor need to know stands in it. Where the packages of the
interfaces are installed, `lupin check` holds the file against their definitions, and the orchestrator does
so whenever it loads the file.

| written in | is about | sees, beside `param` and `constant` |
|---|---|---|
| `with` | what is sent: request, goal or message | the arguments by their names, `now` |
| `done_when`, `code_when`, `detail`, `result` | the answer of a service | `response` |
| the same | how a goal ended | `status` (`succeeded`, `aborted` or `canceled`), `result` |
| `progress` | what an action tells meanwhile | `feedback` |
| `from`, `when` | a message of a topic | `message` |

`param` has the parameters of the binding, `constant` the constants of the interface by name, those of
messages inside it by the message's name: `constant.DiagnosticStatus.ERROR`. `now` is the time of the node,
for stamps.

Fields of messages carry no units: a duration is sent in seconds, a length in metres, an angle in radians.
`unit` says otherwise: the expressions of a binding see the number of an argument or parameter in its unit,
and what they make of an answer or a message is in the unit of the field or value. Quantities beside such a
number are of its unit (`angle + '5 deg'`). Times and durations of ROS are seconds, and a
`geometry_msgs/Pose` is filled from a `pose`, and read as one. What comes over the wire may be calculated
with; what it really is shows where the definition is installed, or when it comes.

An attempt that does not end well ends in a code, with a detail that says why: the first of `code_when` that
is true; `rejected` where the server of an action does not take the goal; `unavailable` where no server is
there, or it goes; otherwise `code`.

[A plugin without Python](bindings.md) shows two; the [tutorial](tutorial-new-mission.md) builds a
mission with a service.
"""
EVENTS: tuple[tuple[str, str], ...] = (
    (
        ", ".join(f"`{name}`" for name in PROFILE.events),
        "requests; who asks is answered, with a reason when refused",
    ),
    (
        "`answer.CHOICE`",
        "an answer to the question of an `ask`, a request as well; `event.by` is `operator` or `default`",
    ),
    (
        "`input.NAME`, `input.NAME.LEVEL`",
        "a yes or no that is true: taken as long as it is, also on entering",
    ),
    ("`PLUGIN.EVENT`", "what a plugin tells of, with the fields that it declares"),
    ("any other name with dots, such as `door.opened`", "raised by an action of the chart"),
    ("`door.*`", "every event that begins like that"),
    (
        '`"*"`',
        "every event but requests and answers, and none of those of one state: endings, timers, levels",
    ),
)


def language() -> Iterator[str]:
    """Yield the page of the language, line by line."""
    yield from LANGUAGE_HEAD.splitlines()
    yield from ("", "## Words")
    for model in models():
        yield from _model(model)
    yield from ("", *ACTIONS_HEAD.splitlines(), "")
    yield from _table(("action", "arguments", "what it does"), _actions())
    yield from ("", "## Events", "", "Under `on`:", "")
    yield from _table(("event", "what it is"), EVENTS)
    yield from _expressions()
    yield from ("", *TIME_OF_DAY_HEAD.splitlines(), "")
    yield from _table(("where", "what happens"), TIMES)
    yield from ("", *TIME_OF_DAY_REST.splitlines())
    yield from _types()
    yield from ("", *BINDINGS_HEAD.splitlines(), "")
    yield from _block("yaml", BINDING.read_text(encoding="utf-8"))
    for model in binding_models():
        yield from _head(model, binding_models())
        yield from _keys(model, binding_file.KIND)


def binding_models() -> list[type[Node]]:
    """Return the models of a binding that no mission has."""
    found: list[type[Node]] = []
    _collect(BindingNode, found)
    return [model for model in found if model not in models()]


def models() -> list[type[Node]]:
    """Return the models that an author writes: files, then what stands in a state, then declarations."""
    files: list[type[Node]] = [*KINDS.values()]
    found = [*files]
    _collect(StateNode, found)
    for kind in files:
        _collect(kind, found)
    return [model for model in found if model is not ActionNode]


def _collect(model: type[Node], found: list[type[Node]]) -> None:
    """Add a model and those that its keys may hold, each after what it stands in."""
    if model not in found:
        found.append(model)
    for field in model.model_fields.values():
        for child in _models_in(field.annotation):
            if child not in found:
                _collect(child, found)


def _models_in(annotation: Any) -> Iterator[type[Node]]:
    if isinstance(annotation, type) and issubclass(annotation, Node):
        yield annotation
    for inner in typing.get_args(annotation):
        yield from _models_in(inner)


def snake(model: type[Node]) -> str:
    """Return what a model is called in file names: `request_field` for RequestFieldNode."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", model.__name__.removesuffix("Node")).lower()


def _title(model: type[Node]) -> str:
    return snake(model).replace("_", " ").capitalize()


def _model(model: type[Node]) -> Iterator[str]:
    yield from _head(model, models())
    yield from _block("yaml", (EXAMPLES / f"{snake(model)}.yaml").read_text(encoding="utf-8"))
    yield ""
    yield from _keys(model, next((word for word, kind in KINDS.items() if kind is model), ""))


def _head(model: type[Node], holders: Iterable[type[Node]]) -> Iterator[str]:
    yield from ("", f"### {_title(model)}", "")
    yield inspect.cleandoc(model.__doc__ or "")
    places = _places_of(model, holders)
    if places:
        yield f"Stands under {places}."
    yield ""


def _keys(model: type[Node], first: str) -> Iterator[str]:
    """Yield the table of keys; what gives the file its kind and name stands first, as in a file."""
    own = sorted(model.model_fields, key=lambda name: name != first)
    rows = (_row(model.model_fields[name], name) for name in own)
    yield from _table(("key", "shape", "when not written", "meaning"), rows)


def _places_of(model: type[Node], holders: Iterable[type[Node]]) -> str:
    """Return the keys that a model stands under, with what they belong to."""
    found: dict[str, list[str]] = {}
    for holder in holders:
        for name, field in holder.model_fields.items():
            if model in _models_in(field.annotation):
                found.setdefault(f"`{field.alias or name}`", []).append(_title(holder).lower())
    if model is TransitionNode:
        return ", ".join(found)
    return ", ".join(f"{key} ({', '.join(holders)})" for key, holders in found.items())


def _row(field: FieldInfo, name: str) -> tuple[str, ...]:
    key = f"`{field.alias or name}`"
    if field.is_required():
        return f"**{key}**", _shape(field), "", field.description or ""
    return key, _shape(field), _default(field.get_default(call_default_factory=True)), field.description or ""


def _default(value: Any) -> str:
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`" if value not in (None, "", (), [], {}) else ""


def _shape(field: FieldInfo) -> str:
    annotation = Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation
    return shape_of(annotation)


def shape_of(annotation: Any) -> str:
    """Return the shape of a key's value in words."""
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _schema_shape(annotation) or shape_of(inner[0])
    if origin in (typing.Union, types.UnionType):
        return " or ".join(shape_of(one) for one in inner if one is not type(None))
    if origin is typing.Literal:
        return " or ".join(f"`{word}`" for word in inner)
    if origin is list:
        return f"one or more {_plural(shape_of(inner[0]))}"
    if origin is dict:
        return f"mapping of {_plural(shape_of(inner[1]).removeprefix('one or more '))}"
    if isinstance(annotation, type) and issubclass(annotation, Node):
        anchor = "actions" if annotation is ActionNode else _title(annotation).lower().replace(" ", "-")
        return f"[{_title(annotation).lower()}](#{anchor})"
    return {str: "text", bool: "`true` or `false`"}[annotation]


def _plural(shape: str) -> str:
    """Return the shape of several; a link's text comes first in brackets."""
    several = re.sub(r"^(\[?[a-z ]*[a-rt-z])(?=$|\])", r"\1s", shape)
    return re.sub(r"(?<=[^aeiou ])ys(?=$|\])", "ies", several)


def _schema_shape(annotation: Any) -> str | None:
    """Return the shape of what may be computed, which is any value to pydantic."""
    known = {"Written": Written, "Condition": Condition, "Bound": Bound}
    schemas = [meta for meta in typing.get_args(annotation)[1:] if isinstance(meta, WithJsonSchema)]
    names = [name for name, alias in known.items() if typing.get_args(alias)[1] in schemas]
    return _COMPUTED[names[0]] if names else None


def _actions() -> Iterator[tuple[str, ...]]:
    for name, text in ACTION_TEXTS.items():
        arguments = builtin_actions(PROFILE).get(name, {})
        shown = [
            f"`{word}`{' (optional)' if argument.optional else ''}: {argument.doc}"
            for word, argument in arguments.items()
        ]
        yield f"`{name}`", "<br>".join(shown), text


def _expressions() -> Iterator[str]:
    yield from ("", *EXPRESSIONS_HEAD.splitlines(), "")
    yield from _table(("name", "what it is"), ((f"`{name}`", ROOT_TEXTS[name]) for name in sorted(ROOTS)))
    yield from ("", "What can be called, besides the functions of the plugins:", "")
    yield from _table(("function", "what it is"), ((f"`{name}`", CALL_TEXTS[name]) for name in BUILTIN_CALLS))


def _types() -> Iterator[str]:
    yield from ("", *TYPES_HEAD.splitlines(), "")
    rows = ((f"`{name}`", _type_text(name)) for name in BUILTIN_TYPES)
    yield from _table(("type", "what it is"), rows)
    yield from ("", *UNITS_HEAD.splitlines(), "")
    by_base: dict[str, list[str]] = {}
    for unit, (base, _) in UNITS.items():
        by_base.setdefault(base, []).append(f"`{unit}`")
    yield from _table(
        ("kept in", "units"),
        ((f"`{base}`" if base else "a plain number", ", ".join(units)) for base, units in by_base.items()),
    )


def _type_text(name: str) -> str:
    found = BUILTIN_TYPES[name]
    if found.fields:
        return "a record of " + ", ".join(f"`{word}` ({kind})" for word, kind in found.fields.items())
    text = {"bool": "`true` or `false`", "integer": "a whole number", "any": "anything"}.get(
        found.kind, f"a text such as `{found.example}`" if found.example else found.kind
    )
    text = f"a number in `{found.unit}`" if found.unit else text
    return f"{text}, at least {found.minimum:g}" if found.minimum is not None else text


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    names = list(head)
    yield f"| {' | '.join(names)} |"
    yield f"|{'---|' * len(names)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


# -- the catalog ------------------------------------------------------------------------------------------

CATALOG_HEAD = """\
# What the plugins offer

What missions can invoke, call and read with the plugins that come with the engine. It is written from their
catalogs; `lupin plugin show NAME` tells the same of every plugin that is installed where you are, and
`lupin plugin list` which those are. How to write one is in [plugins.md](plugins.md).
"""


def catalog() -> Iterator[str]:
    """Yield the page of the plugins that come with the engine, line by line."""
    yield from CATALOG_HEAD.splitlines()
    for point in entry_points():
        if point.distribution is None or point.distribution.name != "lupin-engine":
            continue
        plugin = import_plugin(point)
        yield from ("", f"## {plugin.name}", "", plugin.doc)
        for section in sections(plugin):
            yield from ("", f"### {plugin.name}: {section.title.lower()}", "")
            yield from _section(section)


def _section(section: Section) -> Iterator[str]:
    """Yield things with arguments one by one, others as a table."""
    if section.title in ("Operations", "Actions", "Functions"):
        for number, entry in enumerate(section.entries):
            yield from ("",) * (number > 0)
            yield from _offer(entry)
        return
    facts = list(dict.fromkeys(name for entry in section.entries for name, _ in entry.facts))
    rows = (
        (f"`{entry.name}`", entry.doc, *(dict(entry.facts).get(name, "") for name in facts))
        for entry in section.entries
    )
    yield from _table(("name", "what it is", *facts), rows)


def _offer(entry: Entry) -> Iterator[str]:
    yield from (f"**`{entry.name}`**: {entry.doc}", "")
    rows = [*((f"`{name}`", f"{kind}: {doc}") for name, kind, doc in entry.arguments), *entry.facts]
    yield from _table(("", ""), rows)


#: The pages by name; the name is also that of the file in docs.
PAGES: Mapping[str, Callable[[], Iterator[str]]] = {"rules": rules, "language": language, "catalog": catalog}


def page(name: str) -> str:
    """Return a page."""
    return "\n".join(PAGES[name]()).rstrip("\n") + "\n"


def main() -> None:
    """Write the page that the command line names."""
    if len(sys.argv) != 2 or sys.argv[1] not in PAGES:
        sys.exit(__doc__)
    sys.stdout.write(page(sys.argv[1]))


if __name__ == "__main__":
    main()
