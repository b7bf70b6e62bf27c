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

A mission is a statechart in YAML. This page is for looking things up; the files in `missions/` are the best
introduction, and the [glossary](glossary.md) explains the words of statecharts. A key of a file is its
kind:

- a *lifecycle* is what all missions share: starting up, pausing, driving home. It is `lifecycle.yaml`,
  beside the missions; that of a project usually [extends](#a-lifecycle-that-extends-another) the shipped one;
- a *mission* is what a robot is asked to do. It stands in the lifecycle's slot;
- a *part* is a piece that missions use, in the folder `parts`. A mission may also use another mission;
- a [*binding*](#bindings) connects a ROS service, action or topic that no plugin offers, in the folder
  `bindings`.

Plugins bring the operations, events and live values of missions: see [what they offer](catalog.md).
`lupin check` reports mistakes in a file; [rules.md](rules.md) explains each of them. Each file may say
`lupin: 1`, the version of the language; [stability](stability.md) says what goes on working, and how long.

## How a chart runs

**States.** A state is active or not. An active state has one active child; in a parallel state all
children, the *regions*, are active together. A transition finds its target by name, in the nearest state
around it with a child of that name. Dots lead further down (`RETURNING.DOCKED`). The states of a part that
a state uses come last.

**Events.** An event goes to the innermost active states first, then outwards. Within a state the
transitions are tried in the order of the file, and the first whose guard is true is taken. A transition
without a target runs its actions and leaves nothing.

**Steps.** A transition leaves states (`exit`), runs its actions (`do`) and enters states (`entry`). Then
every enabled transition without an event follows (`always`, levels). Then raised events follow, until
nothing more happens. Only now operations begin. No time passes during a step.

**Fields of events.** `event` has the fields of the current event. Whatever follows in the same step without
another event can read it too: the `entry` and the operation of an entered state, and an `always`. If one
way to an expression does not bring a field, reading it is a finding of the checker. Store the field in a
variable where it is readable.

**Operations.** An operation lives as long as its state; leaving the state cancels it. Its end is `on_done`
or `on_error`. An error without a handler leads to the lifecycle's FAULT, and so does an expression or
action that fails (`error.execution` in `lupin simulate`). `retry` does not count an attempt that ended
because of a hold, or because its state was left. The share of `jitter` is drawn from a seed, the mission
and the attempt: the same inputs give the same pauses.

**Updates.** With `update: 1 s` the arguments of an operation are evaluated again every second while it
runs. Where one has changed, the server gets them as a new goal in place of the old one; nothing is
cancelled. It is the same try, and the `timeout` is that of all goals together. A value that is unknown
changes nothing, and neither do new arguments before the server has taken the last goal. What stops the
operation stops both goals. [Which operations](bindings.md#new-goals-for-a-running-one) can be updated, they
declare.

**Holds.** A *hold*, such as a pause or an emergency stop, suspends the whole chart. Operations that move
the robot are cancelled, clocks stand still, and answers wait. After the release the chart first becomes
stable. Then each cancelled operation whose state is still active begins again, or ends as its `on_hold`
says. Requests are answered at once also during a hold: a transition with `during` or `releases` is taken,
all others are refused.

**Diverts.** A *divert* is a transition of the lifecycle out of the mission: an abort, a request to dock, a
low battery. A state with `before_divert` lets it wait until the state is left, or its time is over. The
operator is told so (`divert_waits`). Its actions and its code come when it is taken. A request takes the
place of the divert that waits. Holds stop the robot at once, also here; an error and an event of a plugin
lead out at once. The next such state lets the divert wait on: its time begins when it is entered.

**Missions.** A mission begins when its request is accepted. Its variables and those of its parts have their
defaults. Its itineraries, budgets and history are new, and its `entry` runs. A return by history, as from
the dock, begins nothing. Variables of the lifecycle keep their values from mission to mission. While an
invariant is broken no mission begins.

**Itineraries.** The published counts and the summary add up all itineraries of a mission. An itinerary that
begins anew adds its targets again. If an itinerary depends on the request alone, its targets are known from
the start. `itinerary.close_rest` closes the itinerary around it. Without one it closes those inside the
state that contains it; in the lifecycle it closes all of the mission, however early that ends. A target
that several itineraries share then gets one outcome, as long as none of them has begun.

**Parts.** A part that a mission uses twice has its variables once. Both uses read and set the same ones,
also at the same time in a `parallel` state. Each goes on with the values that the other has left. To begin
with a value of its own, a use sets it in its `entry`. Each use has its own parameters, by `with`.

**Missions as parts.** `use: inspection` stands for the states of `inspection.yaml` beside the file.

- `with` gives fields of its request; a field that is left out has its default.
- The mission keeps its meaning: it reads its own request. It names its own states and those of the
  lifecycle, none of the mission around it.
- It begins whenever the state is entered, except by history, as a mission does that is started. If it would
  refuse its request, that is an error.
- When it ends, its state takes `on_done` with the `result` of that end.
- A transition to a state of the lifecycle takes the whole mission there. A history returns into the used
  mission, however deep it stands.
- Reports and observations belong to the mission that was started, and `since: mission` counts from its
  start.

**Properties and invariants.** A *property* is true of every run. Tests, proofs and campaigns check it, and
the orchestrator watches it on the robot: its [`breach`](#property) decides what follows there. An
*invariant* holds at every moment, and a broken one always leads to FAULT.

**Codes.** A *code* is the reason of something that happened, with a detail for people. Each report of a
code is an event in the log, the live view and the record of the run, with its target. `last_error` is the
newest of the worst that the mission has reported, and is published with its label. A refused request is
answered with a code, which is not a report.

**Live values.** A live value is *unknown* before its first report, and when that is too old. A guard that
reads an unknown value is false, so test it with `known(...)`. The test in a guard also covers the `do` of
its transition.

## How to read the tables

A *value* is written out (`30 s`, `home`, `[1, 2]`) or an expression in `${ }`. A *condition* is an
expression without `${ }`. *One or more* means that a list of one may be written without the list. A key in
**bold** must be written.
"""

EXTENDING = """\
## A lifecycle that extends another

With `extends: NAME` a lifecycle is the shipped one of that name, with changes: those that the file contains.
The two are merged before anything else happens, so that checks, proofs, pictures and runs see one lifecycle;
`lupin check --expand` prints it. Every finding has the place of the file that has the mistake.

- A mapping is merged key by key: declarations, states and the states in them, `on`, `after`, `every`, `at`,
  `invoke`, `budget`. So `params: {dock_timeout_s: {default: 90 s}}` changes one key of one parameter.
- All else replaces: a transition (with its guard, actions and code), a list, actions, an expression, and an
  `invoke` with a `do`. Nothing can be taken out.
- In document order a new state or event comes after the inherited ones.
- These cannot be overridden: a hold, the severity of its codes, the requests that engage and release it (no
  state answers them, no new hold is engaged by them), and the `on_hold` of an inherited operation; a
  transition with `during` or `releases`; the answers to `mission.start` of inherited states; the inputs and
  parameters that the conditions of holds and of these answers read, and the parameters of the levels of such
  inputs: a robot gets their values as its parameters; the type of a parameter or variable; the profile, the
  slot and the initial state; an invariant. An inherited property may get a stricter `breach`, a `code` and a
  `summary`. No transition of the file `releases` an inherited hold. New holds, invariants and properties may
  be added.
- A new state may refuse a start, and so may one inside an inherited state; none accepts one. But a new
  state, if none around it answers, may copy the answers of an inherited one: `mission.start: {use: READY}`.
  In a new state that does not answer, a start begins nothing, but releases the holds that a start releases.
  No other transition of yours may lead to the state with the `slot`; one to its `history` goes on.
- A name that overrides nothing and cannot be new is an error with the nearest spelling; a value that equals
  the inherited one is a warning.
- `extends/NAME.yaml` beside the file counts before the shipped one: bundles and journals carry theirs there.

`lupin new` begins with such a file. `lupin new --copy` writes a whole lifecycle, which ages: its `origin`
names what it was made of, and `lupin doctor` reports whether that has changed since.
"""
ACTIONS_HEAD = """\
## Actions

Under `entry`, `exit` and `do`: a name, or a mapping of one name to its arguments. A plugin's are called
`PLUGIN.ACTION`.
"""
EXPRESSIONS_HEAD = """\
## Expressions

Expressions are a safe subset of Python, checked when the file is read. It has texts, numbers, `true`,
`false`, `and`, `or`, `not`, comparisons, `in`, `+ - * / // %` of numbers, `x if c else y`, fields of
records and elements of lists. A number with a unit is written as a text where it meets another
(`param.patience > '5 s'`). There are no methods. Lists are not joined: a variable is filled by `add`, an
order is a number for each element. `[tag.id for tag in request.tags if tag.x > '1 m']` makes a list from
another, with one loop and none inside it. In `find` and `sorted` the element is called `t`.

An expression that could take long is refused. A list counts with its `max`, or with 1000 elements where it
has none; a longer one is an error when the expression is evaluated.

Named values of a plugin are read by name, in the unit of its catalog, such as
`event.reading['temperature']`. A name that is missing is unknown, as a live value is before its first
report. Then a guard that reads it is false, and an action is an error, so test it with `known(...)`.

Where a text is wanted, expressions may stand in it: `tag ${ target.id } after ${ param.patience:.1f min }`.
Each is a text, a number with its unit, a yes or no, or a list of those, which is joined with commas. Behind
a colon stand the digits of a number (`.1f`), another unit of its dimension (`min`), or both.

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
The step records that the clock was set, so the log, the record and the story of the run show it. A computed
time (`"${ param.end }"`, of type `time_of_day`) is evaluated when the state is entered and then every day.

`clock.today` and `clock.time` are texts that have an order:
`clock.time >= '22:00' or clock.time < '06:00'`. The passing of time is no event: a guard of an `always`
that reads the clock is evaluated when something else happens. With `use_sim_time` the clock is the
simulated time, counted from 1970 in UTC. A simulation begins on 2026-01-01 at 00:00, or as
[its scenario](testing-missions.md) says, never today.
"""
TYPES_HEAD = """\
## Types and units

Types of parameters, variables and request fields; any of them may follow `list of` or `set of`. A set holds
each element once, in the order in which they came. Plugins add their own types.

*Record types* are declared under `types`, each with its [fields](#record-field), which may be records too.
Those of a mission, a part or the lifecycle are known in the whole chart, those of a [binding](#bindings) in
the missions beside it and in bindings without types: a file `bindings/places.yaml` with nothing but `types`
is the place for what all share. A value has every field of its type; in a file each one is checked, with its
unit and range. On the command line and in scenarios they are written likewise, and each mistake is reported.
Over ROS a parameter that is a list of records, or a record of more than numbers, is a text of JSON. There a
number without a unit is in the base unit, which the parameter's description shows: `"x": 1` is 1 m, and so is
`"x": "100 cm"`.

The `min` and `max` of a parameter that is a list are the numbers of its elements: a table with `min: 1` is
never empty, so `param.wards[0]` is always there. A list with fewer or more is refused wherever it is given.
"""
UNITS_HEAD = """\
A number that has a dimension is written with one of its units, and declared as `type: number` with `unit`.
Only numbers of one dimension are added or compared. A product or a quotient has the dimension that follows:
with `given` an amount of water, `given / '2 l/min'` is a duration. Temperatures are kept in °C, so that
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
    "success leads to a state that was entered from elsewhere; the `.codes` that it reports; the `.divert` "
    "that waits ('' for none); whether something is `.moving` after it, and whether the robot shows that it "
    "is `.waiting`: held, paused, asking, or without a mission",
    "itinerary": "`itinerary.open` (the visit has no outcome yet), `.remaining` (targets after this one), "
    "`.total`, `.closed`, `.sweep` (1 in the first)",
}
CALL_TEXTS: Mapping[str, str] = {
    "len": "`len(list or text)`",
    "min": "`min(list)` or `min(a, b, ...)`",
    "max": "`max(list)` or `max(a, b, ...)`",
    "sum": "`sum(list of numbers)`: their sum; of none 0",
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
    "raise": "raise an event for the whole chart: see [Raise](#raise)",
    "if": "carry out `then` where the guard is true, else `else`: see [If](#if)",
    "itinerary.advance": "go on to the next target; refused while the visit is open",
    "itinerary.close": "give the visit its outcome, once, and publish it; `detail` goes out as the reason of "
    "what is not OK, and with OK stays in the summary of the run",
    "itinerary.close_rest": "close every visit of this sweep that is still open; a state that a budget or an "
    "event ends publishes no outcomes for them without it",
    "report.clear": "forget the code that was reported last",
    "report.note": "say something in the log and in the story of the run",
    "report.summary": "publish what became of every target",
    "publish.reading": "publish a reading that belongs to no visit",
}
BINDINGS_HEAD = """\
## Bindings

A file in the folder `bindings` beside the missions makes a plugin of ROS interfaces, without Python. A
service or an action becomes an operation (`BINDING.OPERATION`). A topic becomes a live value or an event
(`BINDING.EVENT`), and a message to publish an action (`BINDING.ACTION`). The file has all that
`lupin check`, the simulation and your editor need. Where the packages of the interfaces are installed,
`lupin check` compares the file with their definitions. The orchestrator does so whenever it loads the file.

| written in | is about | sees, beside `param` and `constant` |
|---|---|---|
| `with` | what is sent: request, goal or message | the arguments by their names, `now` |
| `done_when`, `code_when`, `detail`, `result` | the answer of a service | `response` |
| the same | how a goal ended | `status` (`succeeded`, `aborted` or `canceled`), `result` |
| `progress` | the feedback of an action | `feedback` |
| `from`, `when` | a message of a topic | `message` |

`param` has the parameters of the binding, `constant` the constants of the interface. Those of messages
inside it are under the message's name: `constant.DiagnosticStatus.ERROR`. `now` is the time of the node,
for stamps.

Fields of messages carry no units: a duration is sent in seconds, a length in metres, an angle in radians.
`unit` changes that. With it, expressions of a binding read an argument or parameter in its unit, and give a
result in the unit of the field or value. Quantities beside such a number are of its unit
(`angle + '5 deg'`). Times and durations of ROS are seconds. A `geometry_msgs/Pose` is filled from a `pose`,
and read as one. Expressions may calculate with fields whose type is not known; it is checked where the
definition is installed, or when the message comes.

A failed attempt ends in a code, with a detail that gives the reason:

- the first of `code_when` that is true;
- `rejected` where the server of an action does not take the goal;
- `unavailable` where no server is there, or it goes;
- otherwise `code`.

[A plugin without Python](bindings.md) shows two bindings; the [tutorial](tutorial-new-mission.md) builds a
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
    ("`PLUGIN.EVENT`", "what a plugin reports, with the fields that it declares"),
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
    yield from ("", *EXTENDING.splitlines(), "", "## Words")
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
        each = shape_of(inner[0])
        return f"list of {each}" if each.startswith("mapping of") else f"one or more {_plural(each)}"
    if origin is dict:
        return f"mapping of {_plural(shape_of(inner[1]).removeprefix('one or more '))}"
    if isinstance(annotation, type) and issubclass(annotation, Node):
        anchor = "actions" if annotation is ActionNode else _title(annotation).lower().replace(" ", "-")
        return f"[{_title(annotation).lower()}](#{anchor})"
    return {str: "text", int: "whole number", bool: "`true` or `false`"}[annotation]


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
