"""What is worked out while a mission runs: expressions, what they see, and constants with the same face."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.chart.expressions.records import record
from lupin_engine.errors import Place
from lupin_engine.plugin.types import Type

#: What an expression sees: the records param, request, input, event, error, target and itinerary; `item`
#: (what a `for_each` is at); `context` (variables by name); and the callables `known(input)`, `held(hold)`,
#: `in_state(full_names)` and, in `functions`, those of the plugins by full name.
Environment = Mapping[str, Any]


class UnknownInput(Exception):
    """An expression read a live value that is not known: never reported, or older than its freshness."""

    def __init__(self, name: str) -> None:
        super().__init__(f"input.{name} is unknown")
        self.name = name


class Compiled:
    """A function of the environment that is compiled from checked code when it is first needed."""

    __slots__ = ("_code", "_compile", "_function")

    def __init__(self, code: str, compile: Callable[[str], Callable[[Environment], Any]]) -> None:
        self._code = code
        self._compile = compile
        self._function: Callable[[Environment], Any] | None = None

    def __call__(self, env: Environment) -> Any:
        """Evaluate in an environment."""
        return (self._function or self.compiled())(env)

    def compiled(self) -> Callable[[Environment], Any]:
        """Return the plain function, for those who call it often."""
        if self._function is None:
            self._function = self._compile(self._code)
        return self._function


@record(frozen=True)
class Expression:
    """A typed, compiled expression; `evaluate` reads an environment and has no side effect.

    `evaluate` is mostly a `Compiled`, whose plain function is a little faster. `parts` are the operands of
    its outermost and/or/not as (text, function), for saying why a guard failed.
    """

    source: str
    place: Place
    type: Type
    evaluate: Callable[[Environment], Any]
    parts: tuple[tuple[str, Callable[[Environment], Any]], ...] = ()


@record(frozen=True)
class Constant:
    """A value that is written out; has the same face as an expression."""

    value: Any
    place: Place
    type: Type

    def evaluate(self, _: Environment) -> Any:
        """Return the value."""
        return self.value


Value = Expression | Constant
