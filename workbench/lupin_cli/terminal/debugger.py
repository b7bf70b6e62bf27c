"""A debugger of simulations: executes typed commands and returns lines; deterministic, without a terminal.

`Debugger.do` takes one line as it was typed; a wrong word is answered with the nearest spelling and changes
nothing. The same lines give the same answers.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from lupin_cli.terminal import panels
from lupin_cli.terminal.rewind import Move, Rewindable, effect, go_on, wait_until
from lupin_engine.chart import Chart
from lupin_engine.errors import LupinError, nearest
from lupin_engine.machine import Possibility, World
from lupin_engine.plugin import START
from lupin_engine.replay import TonedLine, laid_out, usual_columns
from lupin_engine.sim import Effect, Hand, Read, Script, Simulation, Wrong, is_named, label_of, narrate

#: A mission that never ends is stopped after so many steps of one `run`.
MOST_STEPS = 10_000
_MOST_DIGITS = 9
#: Steps in which nothing is told (a server accepts) are joined to the next one, up to so many.
_SILENT = 100


@dataclass(frozen=True)
class DebuggerCommand:
    """A command: its usage, its effect, and the completions of its arguments.

    `act` returns lines to print, or an effect to apply to the simulation. `first` completes the first
    argument, `then` the one after it.
    """

    usage: str
    about: str
    act: Callable[[Any, list[str]], list[TonedLine] | Effect]
    first: Callable[[Any], Iterable[str]]
    then: Callable[[Any, str], Iterable[str]]


#: What can be typed first, in the order in which help tells it.
COMMANDS: dict[str, DebuggerCommand] = {}

_Act = TypeVar("_Act", bound=Callable[[Any, list[str]], list[TonedLine] | Effect])


def _command(
    usage: str,
    about: str,
    first: Callable[[Any], Iterable[str]] = lambda debugger: (),
    then: Callable[[Any, str], Iterable[str]] = lambda debugger, word: (),
) -> Callable[[_Act], _Act]:
    """Register a method of the debugger as the command of the first word of `usage`."""

    def register(act: _Act) -> _Act:
        COMMANDS[usage.split()[0]] = DebuggerCommand(usage, about, act, first, then)
        return act

    return register


class Debugger:
    """One simulation, controlled by typed commands.

    Args:
        read: reads values as they are typed.
        world: of this chart and its parameters; it is shared by all the simulations that going back needs.
        width: of the terminal, in cells.
    """

    def __init__(self, chart: Chart, script: Script, world: World, read: Read, width: int = 100) -> None:
        self._chart, self._catalog, self._script, self._world = chart, chart.catalog, script, world
        self._hand = Hand(script, world, read, lambda: self.simulation)
        self._columns = usual_columns(width)
        self._rewindable = Rewindable(self._begun)
        self._shown = 0
        self.over = False

    def _begun(self) -> Simulation:
        simulation = Simulation(self._chart, self._script, {}, self._world)
        simulation.begin()
        # Starting up takes no time in most charts; nobody wants to step through it.
        while simulation.next_due == 0.0 and not simulation.is_over:
            simulation.advance()
        return simulation

    # -- for whoever shows it -----------------------------------------------------------------------------

    @property
    def simulation(self) -> Simulation:
        """The simulation as it is now."""
        return self._rewindable.simulation

    @property
    def prompt(self) -> str:
        """The prompt: time (s) and state of the simulation."""
        view = self.simulation.machine.view
        where = " ".join(filter(None, (view.lifecycle, view.phase)))
        held = f" [{', '.join(view.held)}]" if view.held else ""
        return f"{self.simulation.now:.1f} s {where}{held}> "

    def greeting(self) -> list[TonedLine]:
        """Return the lines before the first command."""
        return [*self._news(), [("help tells what can be typed, why what can happen; quit ends", "dim")]]

    def do(self, line: str) -> list[TonedLine]:
        """Execute a typed line, and return the lines to print."""
        try:
            words = shlex.split(line, comments=True)
        except ValueError as problem:
            return _refused(f"this cannot be read: {str(problem).lower()}")
        if not words:
            return []
        try:
            come = _known(words[0]).act(self, words[1:])
            return come if isinstance(come, list) else self._let(" ".join(words), come)
        except LupinError as problem:
            return _refused(str(problem))

    def complete(self, line: str) -> list[str]:
        """Return the completions of the last word of a line."""
        *before, last = line.split(" ")
        before = [word for word in before if word]
        if not before:
            return [name for name in COMMANDS if name.startswith(last)]
        command = COMMANDS.get(before[0])
        if command is None:
            return []
        words = command.then(self, before[1]) if before[1:] else command.first(self)
        return sorted({word for word in words if word.startswith(last)})

    def interrupted(self) -> list[TonedLine]:
        """Go on after Ctrl-C in the middle of something: a step may have been left half done."""
        self._rewindable.again()
        return [*self._news(), [("interrupted", "note")]]

    # -- names and values ---------------------------------------------------------------------------------

    def _request_words(self, before: str = "") -> list[str]:
        return [f"{name}=" for name in self._hand.request]

    def _event_words(self, event: str) -> list[str]:
        if event == START:
            return self._request_words()
        known = self._catalog.events.get(event)
        return [f"{name}=" for name in known.fields] if known else []

    def _choices(self, name: str) -> Iterable[str]:
        return self._hand.choices(name)

    def _codes(self, operation: str) -> list[str]:
        return self._hand.codes(operation)

    def _result_words(self, operation: str) -> list[str]:
        return [f"{name}=" for name in self._hand.results(operation)]

    def _possible(self) -> dict[str, Possibility]:
        return {found.event: found for found in self.simulation.machine.explain(self.simulation.now)}

    def _listened_to(self) -> set[str]:
        """Return the events of `Machine.explain`, requests also without their first word."""
        found = self._possible()
        return {*found, *(event.removeprefix("operator.") for event in found)}

    def event_names(self) -> list[str]:
        """Return the names of requests and events that can be sent."""
        return self._hand.event_names()

    def value_names(self) -> dict[str, str]:
        """Return the names of live values that can be set, each with the plugin's name for it."""
        return self._hand.value_names()

    def state_names(self) -> list[str]:
        """Return how states can be called: in full, or by their last names."""
        names: dict[str, None] = {}
        for name in filter(None, self._chart.states):
            parts = name.split(".")
            names.update(dict.fromkeys(".".join(parts[index:]) for index in range(len(parts))))
        return list(names)

    def operations_under_way(self) -> list[str]:
        """Return the operations that could end now."""
        return self._hand.operations_under_way()

    def _lifecycle(self) -> str:
        return label_of(self._chart, self.simulation.machine.memory.configuration)

    def _stands_still(self) -> TonedLine:
        view = self.simulation.machine.view
        waits = "it waits for the operator" if view.paused else "nothing will happen by itself"
        return [(f"{waits}; why tells what is possible", "note")]

    # -- what happens -------------------------------------------------------------------------------------

    def _news(self) -> list[TonedLine]:
        """Return the lines of steps that were not shown yet."""
        lines = narrate(self._chart, self.simulation.history, self._shown)
        self._shown = len(self.simulation.steps)
        return [row for line in lines for row in laid_out(line, self._columns)]

    def _let(self, text: str, what: Effect) -> list[TonedLine]:
        """Apply an effect, and return the lines of the steps that follow; Wrong where it has no effect."""
        if not self._rewindable.do(effect(text, what)):
            raise Wrong("nothing came of that")
        return self._news() or [[("nothing came of that", "dim")]]

    def _step(self) -> list[TonedLine]:
        """Advance to the next step that is shown."""
        news: list[TonedLine] = []
        done = 0
        while not news and done < _SILENT and self._rewindable.do(go_on(1)):
            done += 1
            news = self._news()
        self._rewindable.join(done)
        return news

    @_command(
        "start [NAME=VALUE ...]", "start the mission; fields of its request", _request_words, _request_words
    )
    def _start(self, words: list[str]) -> Effect:
        return self._hand.start(words)

    @_command("send EVENT [NAME=VALUE ...]", "an operator asks, or a plugin tells", event_names, _event_words)
    def _send(self, words: list[str]) -> Effect:
        return self._hand.send(words)

    @_command("set VALUE X", "a live value changes", value_names, _choices)
    def _set(self, words: list[str]) -> Effect:
        return self._hand.set(words)

    @_command("fail OPERATION CODE [TEXT]", "an operation under way fails", operations_under_way, _codes)
    def _fail(self, words: list[str]) -> Effect:
        return self._hand.fail(words)

    @_command(
        "done OPERATION [NAME=VALUE ...]",
        "an operation under way ends well",
        operations_under_way,
        _result_words,
    )
    def _done(self, words: list[str]) -> Effect:
        return self._hand.done(words)

    @_command("clock [DATE TIME]", "what the robot's clock shows; with a date and a time of day it is set")
    def _clock(self, words: list[str]) -> list[TonedLine] | Effect:
        return self._hand.clock(words) if words else [[(self.simulation.clock, "")]]

    @_command("step [N]", "let the next thing happen")
    def _steps(self, words: list[str]) -> list[TonedLine]:
        rows: list[TonedLine] = []
        for _ in range(_count(words)):
            news = self._step()
            rows += news
            if not news:
                return [*rows, self._stands_still()]
        return rows

    @_command("run [DURATION | STATE]", "go on to the end, so long, or until there", state_names)
    def _run(self, words: list[str]) -> list[TonedLine]:
        text = " ".join(words)
        if text[:1].isdigit():
            return self._run_for(self._hand.duration(text))
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

    @_command("back [N]", "take the last moves back, with all that came of them")
    def _back(self, words: list[str]) -> list[TonedLine]:
        if not self._rewindable.moves:
            raise Wrong("there is nothing to take back")
        taken = self._rewindable.back(_count(words))
        self._shown = len(self.simulation.steps)
        return [[(f"took back {_summed(taken)}", "note")]]

    # -- what there is to see -----------------------------------------------------------------------------

    @_command("why [EVENT]", "what is possible now, and why not the rest", _listened_to)
    def _why(self, words: list[str]) -> list[TonedLine]:
        found = self._possible()
        if not words:
            return panels.possibilities(self._chart, found.values())
        name = f"operator.{words[0]}" if f"operator.{words[0]}" in found else words[0]
        if name not in found:
            raise Wrong(f"nothing listens to {name!r}; {nearest(name, self._listened_to())}")
        return panels.possibility(self._chart, found[name])

    @_command("where", "the state, the target, what is under way")
    def _where(self, words: list[str]) -> list[TonedLine]:
        return panels.where(self._chart, self.simulation.machine.view)

    @_command("inputs", "the live values")
    def _inputs(self, words: list[str]) -> list[TonedLine]:
        return panels.inputs(self._chart, self.simulation)

    @_command("variables", "the variables of the chart")
    def _variables(self, words: list[str]) -> list[TonedLine]:
        return panels.variables(self.simulation)

    @_command("timers", "what will happen by itself, and when")
    def _timers(self, words: list[str]) -> list[TonedLine]:
        return panels.timers(self._chart, self.simulation)

    @_command("history", "the moves that led here")
    def _history(self, words: list[str]) -> list[TonedLine]:
        moves = enumerate(self._rewindable.moves, 1)
        rows = [[(f"{number:5}  ", "dim"), (move.text, "")] for number, move in moves]
        return rows or [[("no moves so far", "dim")]]

    @_command("help [COMMAND]", "this list", lambda _: list(COMMANDS))
    def _help(self, words: list[str]) -> list[TonedLine]:
        if words:
            command = _known(words[0])
            return [[(command.usage, "bold")], [(f"  {command.about}", "")]]
        return [panels.labelled(command.usage, command.about, width=32) for command in COMMANDS.values()]

    @_command("quit", "end")
    def _quit(self, words: list[str]) -> list[TonedLine]:
        self.over = True
        return []


# -- small pieces -----------------------------------------------------------------------------------------


def _count(words: list[str]) -> int:
    if not words:
        return 1
    digits = words[0].lstrip("0")
    if not (digits.isascii() and digits.isdecimal()):
        raise Wrong(f"{words[0]!r} is no number of moves; write 1 or more")
    return MOST_STEPS if len(digits) > _MOST_DIGITS else min(int(digits), MOST_STEPS)


def _known(word: str) -> DebuggerCommand:
    if word not in COMMANDS:
        raise Wrong(f"unknown command {word!r}; {nearest(word, COMMANDS)}")
    return COMMANDS[word]


def _refused(text: str) -> list[TonedLine]:
    return [[(line, "refused")] for line in text.splitlines()]


def _summed(moves: list[Move]) -> str:
    """Return moves in few words, the last one first."""
    texts = list(dict.fromkeys(move.text for move in reversed(moves)))
    counts = {text: sum(move.text == text for move in moves) for text in texts}
    return ", ".join(f"{counts[text]} x {text}" if counts[text] > 1 else text for text in texts)
