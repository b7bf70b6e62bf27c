"""A simulation at a terminal: commands in, lines out. Deterministic, and without a terminal of its own.

`Debugger.do` takes one line as it was typed; a wrong word is answered with the nearest spelling and changes
nothing. The same lines give the same answers.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError, nearest
from lupin_engine.machine.scope import World
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.types import ANY, DURATION, Type, convert
from lupin_engine.replay import panels
from lupin_engine.replay.rewind import Move, Rewindable, effect, go_on, wait_until
from lupin_engine.replay.story import TonedLine, laid_out, usual_columns
from lupin_engine.sim.narration import tell
from lupin_engine.sim.simulation import (
    Ask,
    Effect,
    End,
    Happen,
    Script,
    Simulation,
    Tell,
    is_named,
    label_of,
)

#: Reads a word as a value of a type; what does not fit is returned as it is.
Read = Callable[[str, Type], Any]

#: A mission that never ends is stopped after so many steps of one `run`.
MOST_STEPS = 10_000
_MOST_DIGITS = 9
#: Steps in which nothing is told (a server accepts) are joined to the next one, up to so many.
_SILENT = 100


class Wrong(Exception):
    """What was typed cannot be done; the text says why, and what can."""


@dataclass(frozen=True)
class DebuggerCommand:
    """A word that can be typed first: how it is written, what it does, and the words that can follow."""

    usage: str
    about: str
    act: Callable[[Debugger, list[str]], list[TonedLine]]
    words: Callable[[Debugger, list[str]], Iterable[str]] = lambda debugger, before: ()


class Debugger:
    """One simulation that is worked by hand.

    Args:
        read: reads values as they are typed.
        world: of this chart and its parameters; it is shared by all the simulations that going back needs.
        width: of the terminal, in cells.
    """

    def __init__(self, chart: Chart, script: Script, world: World, read: Read, width: int = 100) -> None:
        self._chart, self._catalog, self._script, self._world = chart, chart.catalog, script, world
        self._read = read
        self._columns = usual_columns(width)
        self._rewindable = Rewindable(self._begun)
        self._told = 0
        self.over = False

    def _begun(self) -> Simulation:
        simulation = Simulation(self._chart, self._script, {}, self._world)
        simulation.begin()
        # Starting up takes no time in most charts; nobody wants to step through it.
        while simulation.next_due == 0.0 and not simulation.is_over:
            simulation.go_on()
        return simulation

    # -- for whoever shows it -----------------------------------------------------------------------------

    @property
    def simulation(self) -> Simulation:
        """The simulation as it is now."""
        return self._rewindable.simulation

    @property
    def prompt(self) -> str:
        """Where we are: the time and the state."""
        view = self.simulation.machine.view
        where = " ".join(filter(None, (view.lifecycle, view.phase)))
        held = f" [{', '.join(view.held)}]" if view.held else ""
        return f"{self.simulation.now:.1f} s {where}{held}> "

    def greeting(self) -> list[TonedLine]:
        """Return what is told before anything was typed."""
        return [*self._news(), [("help tells what can be typed, why what can happen; quit ends", "dim")]]

    def do(self, line: str) -> list[TonedLine]:
        """Do what was typed and return what there is to say."""
        try:
            words = shlex.split(line, comments=True)
        except ValueError as problem:
            return _refused(f"this cannot be read: {str(problem).lower()}")
        if not words:
            return []
        try:
            return self._command(words[0]).act(self, words[1:])
        except Wrong as problem:
            return _refused(str(problem))
        except LupinError as problem:
            return _refused(str(problem))

    def complete(self, line: str) -> list[str]:
        """Return the words that could stand at the end of what was typed so far."""
        *before, last = line.split(" ")
        before = [word for word in before if word]
        if not before:
            return [name for name in COMMANDS if name.startswith(last)]
        command = COMMANDS.get(before[0])
        words = command.words(self, before[1:]) if command else ()
        return sorted({word for word in words if word.startswith(last)})

    def interrupted(self) -> list[TonedLine]:
        """Go on after Ctrl-C in the middle of something: a step may have been left half done."""
        self._rewindable.again()
        return [*self._news(), [("interrupted", "note")]]

    # -- what happens -------------------------------------------------------------------------------------

    def _command(self, word: str) -> DebuggerCommand:
        if word not in COMMANDS:
            raise Wrong(f"unknown command {word!r}; {nearest(word, COMMANDS)}")
        return COMMANDS[word]

    def _news(self) -> list[TonedLine]:
        """Tell the steps that were not told yet."""
        lines = tell(self._chart, self.simulation.history, self._told)
        self._told = len(self.simulation.steps)
        return [row for line in lines for row in laid_out(line, self._columns)]

    def _let(self, text: str, what: Effect) -> list[TonedLine]:
        """Let something happen and tell what comes of it."""
        if not self._rewindable.do(effect(text, what)):
            raise Wrong("nothing came of that")
        return self._news() or [[("nothing came of that", "dim")]]

    def _step(self) -> list[TonedLine]:
        """Let the next thing happen that is worth a line."""
        news: list[TonedLine] = []
        done = 0
        while not news and done < _SILENT and self._rewindable.do(go_on(1)):
            done += 1
            news = self._news()
        self._rewindable.join(done)
        return news

    def start(self, words: list[str]) -> list[TonedLine]:
        """Start the mission."""
        fields = self._chart.missions[self._script.mission].request
        data = self._fields(words, {name: field.type for name, field in fields.items()})
        return self._let(_typed("start", words), Ask(START, data))

    def send(self, words: list[str]) -> list[TonedLine]:
        """Let an operator ask for something, or a plugin tell something."""
        name = _first(words, "which event", self.event_names())
        if name == START:
            return self.start(words[1:])
        if name in self._chart.profile.requests:
            name = f"operator.{name}"
        if name in self._chart.profile.events:
            return self._let(_typed("send", words), Ask(name, self._fields(words[1:], {})))
        if name not in self._catalog.events:
            raise Wrong(f"unknown event {name!r}; {nearest(name, self.event_names())}")
        fields = self._fields(words[1:], self._catalog.events[name].fields)
        return self._let(_typed("send", words), Happen(name, fields))

    def set(self, words: list[str]) -> list[TonedLine]:
        """Let a live value change."""
        names = self.value_names()
        name = _first(words, "which value", names)
        if name not in names:
            raise Wrong(f"unknown value {name!r}; {nearest(name, names)}")
        if len(words) < 2:
            raise Wrong(f"to what? {name} is a {self._catalog.values[names[name]].type}")
        value = self._value(name, " ".join(words[1:]), self._catalog.values[names[name]].type)
        return self._let(_typed("set", words), Tell(names[name], value))

    def fail(self, words: list[str]) -> list[TonedLine]:
        """Let an operation under way fail."""
        operation = self._under_way(words)
        codes = [code.name for code in self._catalog.operations[operation].codes]
        code = _first(words[1:], "with which code", codes)
        if code not in codes:
            raise Wrong(f"{operation} has no code {code!r}; {nearest(code, codes)}")
        return self._let(_typed("fail", words), End(operation, code, " ".join(words[2:])))

    def done(self, words: list[str]) -> list[TonedLine]:
        """Let an operation under way end well."""
        operation = self._under_way(words)
        fields = self._fields(words[1:], self._catalog.operations[operation].result)
        return self._let(_typed("done", words), End(operation, result=fields))

    def step(self, words: list[str]) -> list[TonedLine]:
        """Let the next things happen by themselves."""
        rows: list[TonedLine] = []
        for _ in range(_count(words)):
            news = self._step()
            rows += news
            if not news:
                return [*rows, self._stands_still()]
        return rows

    def run(self, words: list[str]) -> list[TonedLine]:
        """Go on for a while, to a state, or to the end."""
        text = " ".join(words)
        if text[:1].isdigit():
            return self._run_for(self._duration(text))
        if text and text not in self.state_names():
            raise Wrong(f"no state {text!r}; {nearest(text, self.state_names())}")
        rows: list[TonedLine] = []
        for _ in range(MOST_STEPS):
            if self.simulation.is_over:
                return [*rows, [(f"the mission is over: {self._lifecycle()}", "note")]]
            before = len(self.simulation.steps)
            news = self._step()
            rows += news
            if not news:
                return [*rows, self._stands_still()]
            entered = (name for step in self.simulation.steps[before:] for name in step.entered)
            if text and any(is_named(name, text) for name in entered):
                return rows
        return [*rows, [(f"stopped after {MOST_STEPS} steps; run goes on", "note")]]

    def _run_for(self, seconds: float) -> list[TonedLine]:
        end = self.simulation.now + seconds
        rows: list[TonedLine] = []
        for _ in range(MOST_STEPS):
            due = self.simulation.next_due
            if due is None or due > end:
                self._rewindable.do(wait_until(end))
                return rows
            self._rewindable.do(go_on(1))
            rows += self._news()
        return [*rows, [(f"stopped after {MOST_STEPS} steps; run goes on", "note")]]

    def back(self, words: list[str]) -> list[TonedLine]:
        """Take moves back."""
        if not self._rewindable.moves:
            raise Wrong("there is nothing to take back")
        taken = self._rewindable.back(_count(words))
        self._told = len(self.simulation.steps)
        return [[(f"took back {_summed(taken)}", "note")]]

    # -- what there is to see -----------------------------------------------------------------------------

    def why(self, words: list[str]) -> list[TonedLine]:
        """Tell what is possible now, and why not the rest."""
        found = {p.event: p for p in self.simulation.machine.explain(self.simulation.now)}
        if not words:
            return panels.possibilities(self._chart, found.values())
        name = f"operator.{words[0]}" if f"operator.{words[0]}" in found else words[0]
        if name not in found:
            names = {*found, *(event.removeprefix("operator.") for event in found)}
            raise Wrong(f"nothing listens to {name!r}; {nearest(name, names)}")
        return panels.possibility(self._chart, found[name])

    def where(self, words: list[str]) -> list[TonedLine]:
        """Tell where the machine is and what is under way."""
        return panels.where(self._chart, self.simulation.machine.view)

    def inputs(self, words: list[str]) -> list[TonedLine]:
        """Tell the live values."""
        return panels.inputs(self._chart, self.simulation)

    def timers(self, words: list[str]) -> list[TonedLine]:
        """Tell what will happen by itself."""
        return panels.timers(self._chart, self.simulation)

    def history(self, words: list[str]) -> list[TonedLine]:
        """Tell the moves that led here."""
        rows: list[TonedLine] = []
        for number, move in enumerate(self._rewindable.moves, 1):
            rows.append([(f"{number:5}  ", "dim"), (move.text, "")])
        return rows or [[("no moves so far", "dim")]]

    def help(self, words: list[str]) -> list[TonedLine]:
        """Tell what can be typed."""
        if words:
            command = self._command(words[0])
            return [[(command.usage, "bold")], [(f"  {command.about}", "")]]
        return [panels.labelled(command.usage, command.about, width=32) for command in COMMANDS.values()]

    def quit(self, words: list[str]) -> list[TonedLine]:
        """End the debugger."""
        self.over = True
        return []

    # -- names and values ---------------------------------------------------------------------------------

    def event_names(self) -> list[str]:
        """Return what can be sent: requests, also without their first word, and the plugins' events."""
        return [*self._chart.profile.events, *self._chart.profile.requests, *self._catalog.events]

    def value_names(self) -> dict[str, str]:
        """Return what can be set: the chart's names and the plugins' names, each with the plugin's name."""
        specs = self._chart.inputs.values()
        return {spec.value: spec.value for spec in specs} | {spec.name: spec.value for spec in specs}

    def state_names(self) -> list[str]:
        """Return how states can be called: in full, or by their last names."""
        names: dict[str, None] = {}
        for name in filter(None, self._chart.states):
            parts = name.split(".")
            names.update(dict.fromkeys(".".join(parts[index:]) for index in range(len(parts))))
        return list(names)

    def operations_under_way(self) -> list[str]:
        """Return the operations that could end now."""
        view = self.simulation.machine.view
        return list(dict.fromkeys([*(a.operation for a in view.attempts), *view.cancelling]))

    def _under_way(self, words: list[str]) -> str:
        running = self.operations_under_way()
        if not running:
            raise Wrong("no operation is under way")
        name = _first(words, "which operation", running)
        if name not in running:
            if name in self._catalog.operations:
                raise Wrong(f"{name} is not under way; {', '.join(running)} is")
            raise Wrong(f"unknown operation {name!r}; {nearest(name, running)}")
        return name

    def _fields(self, words: Iterable[str], types: Mapping[str, Type]) -> dict[str, Any]:
        """Read `name=value` words."""
        found = {}
        for word in words:
            name, equals, text = word.partition("=")
            if not equals:
                raise Wrong(f"{word!r} has no '='; write NAME=VALUE")
            if name not in types:
                raise Wrong(f"unknown field {name!r}; {nearest(name, types)}")
            found[name] = self._request_value(name, text, types[name])
        return found

    def _request_value(self, name: str, text: str, kind: Type) -> Any:
        """Read a field; one of a plugin's type, such as a tag, is left to the plugin's reader."""
        item = kind.item
        if kind.name in self._world.readers:
            return text
        if item is not None and item.name in self._world.readers:
            return [part for part in text.strip("[]").replace(" ", "").split(",") if part]
        return self._value(name, text, kind)

    def _value(self, name: str, text: str, kind: Type) -> Any:
        if kind is ANY:
            return text
        try:
            return convert(self._read(text, kind), kind)
        except ValueError as problem:
            raise Wrong(f"{name}: {problem}") from None

    def _duration(self, text: str) -> float:
        try:
            return float(convert(text, DURATION))
        except ValueError:
            raise Wrong(f"{text!r} is no duration; write one such as '90 s' or '20 min'") from None

    def _lifecycle(self) -> str:
        return label_of(self._chart, self.simulation.machine.memory.configuration)

    def _stands_still(self) -> TonedLine:
        view = self.simulation.machine.view
        waits = "it waits for the operator" if view.paused else "nothing will happen by itself"
        return [(f"{waits}; why tells what is possible", "note")]


# -- small pieces -----------------------------------------------------------------------------------------


def _first(words: list[str], question: str, allowed: Iterable[str]) -> str:
    if not words:
        raise Wrong(f"{question}? {', '.join(sorted(allowed)) or 'there is none'}")
    return words[0]


def _count(words: list[str]) -> int:
    if not words:
        return 1
    digits = words[0].lstrip("0")
    if not (digits.isascii() and digits.isdecimal()):
        raise Wrong(f"{words[0]!r} is no number of moves; write 1 or more")
    # Python reads no number of more than 4,300 digits, and nobody means one.
    return MOST_STEPS if len(digits) > _MOST_DIGITS else min(int(digits), MOST_STEPS)


def _typed(command: str, words: list[str]) -> str:
    return " ".join([command, *words])


def _refused(text: str) -> list[TonedLine]:
    return [[(line, "refused")] for line in text.splitlines()]


def _summed(moves: list[Move]) -> str:
    """Return moves in few words, the last one first."""
    texts = list(dict.fromkeys(move.text for move in reversed(moves)))
    counts = {text: sum(move.text == text for move in moves) for text in texts}
    return ", ".join(f"{counts[text]} x {text}" if counts[text] > 1 else text for text in texts)


# -- what can be typed ------------------------------------------------------------------------------------


def _start_words(debugger: Debugger, before: list[str]) -> Iterator[str]:
    mission = debugger._chart.missions[debugger._script.mission]
    yield from (f"{name}=" for name in mission.request)


def _send_words(debugger: Debugger, before: list[str]) -> Iterator[str]:
    if not before:
        yield from debugger.event_names()
    elif before[0] == START:
        yield from _start_words(debugger, [])
    elif before[0] in debugger._catalog.events:
        yield from (f"{name}=" for name in debugger._catalog.events[before[0]].fields)


def _set_words(debugger: Debugger, before: list[str]) -> Iterator[str]:
    names = debugger.value_names()
    if not before:
        yield from names
    elif before[0] in names:
        kind = debugger._catalog.values[names[before[0]]].type
        yield from ("true", "false") if kind.kind == "bool" else kind.values


def _fail_words(debugger: Debugger, before: list[str]) -> Iterator[str]:
    if not before:
        yield from debugger.operations_under_way()
    elif len(before) == 1 and before[0] in debugger._catalog.operations:
        yield from (code.name for code in debugger._catalog.operations[before[0]].codes)


def _done_words(debugger: Debugger, before: list[str]) -> Iterator[str]:
    if not before:
        yield from debugger.operations_under_way()
    elif before[0] in debugger._catalog.operations:
        yield from (f"{name}=" for name in debugger._catalog.operations[before[0]].result)


def _run_words(debugger: Debugger, before: list[str]) -> Iterable[str]:
    return debugger.state_names() if not before else ()


def _why_words(debugger: Debugger, before: list[str]) -> Iterable[str]:
    if before:
        return ()
    events = [found.event for found in debugger.simulation.machine.explain(debugger.simulation.now)]
    return [*events, *(name.removeprefix("operator.") for name in events)]


COMMANDS: Mapping[str, DebuggerCommand] = {
    "start": DebuggerCommand(
        "start [NAME=VALUE ...]", "start the mission; fields of its request", Debugger.start, _start_words
    ),
    "send": DebuggerCommand(
        "send EVENT [NAME=VALUE ...]", "an operator asks, or a plugin tells", Debugger.send, _send_words
    ),
    "set": DebuggerCommand("set VALUE X", "a live value changes", Debugger.set, _set_words),
    "fail": DebuggerCommand(
        "fail OPERATION CODE [TEXT]", "an operation under way fails", Debugger.fail, _fail_words
    ),
    "done": DebuggerCommand(
        "done OPERATION [NAME=VALUE ...]", "an operation under way ends well", Debugger.done, _done_words
    ),
    "step": DebuggerCommand("step [N]", "let the next thing happen", Debugger.step),
    "run": DebuggerCommand(
        "run [DURATION | STATE]", "go on to the end, so long, or until there", Debugger.run, _run_words
    ),
    "back": DebuggerCommand(
        "back [N]", "take the last moves back, with all that came of them", Debugger.back
    ),
    "why": DebuggerCommand(
        "why [EVENT]", "what is possible now, and why not the rest", Debugger.why, _why_words
    ),
    "where": DebuggerCommand("where", "the state, the target, what is under way", Debugger.where),
    "inputs": DebuggerCommand("inputs", "the live values", Debugger.inputs),
    "timers": DebuggerCommand("timers", "what will happen by itself, and when", Debugger.timers),
    "history": DebuggerCommand("history", "the moves that led here", Debugger.history),
    "help": DebuggerCommand(
        "help [COMMAND]", "this list", Debugger.help, lambda debugger, before: () if before else COMMANDS
    ),
    "quit": DebuggerCommand("quit", "end", Debugger.quit),
}
