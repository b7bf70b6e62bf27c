"""Stock `transitions`, the flat Machine: queued, with send_event, without automatic transitions."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any

from bench import BOUND, FIRST_EVENTS, Bench, Unsupported, reached
from transitions import EventData, Machine

VERSION = f"transitions {version('transitions')}"

_STATES = ["a", "b", "c"]


class Model:
    """What the machine moves. Its trigger `go` and its `state` are put on by the machine."""

    go: Callable[[], bool]
    state: Any

    def __init__(self) -> None:
        self.count = 0

    def below(self, event: EventData) -> bool:
        """The guard."""
        return self.count < BOUND

    def add(self, event: EventData) -> None:
        """The action."""
        self.count += 1


def transitions(chart: str, prefix: str = "") -> list[dict[str, Any]]:
    """Return the cycle's transitions, with guard and action when the chart has them."""
    extra = {"conditions": "below", "before": "add"} if chart == "guarded" else {}
    following = [*_STATES[1:], _STATES[0]]
    return [
        {"trigger": "go", "source": prefix + one, "dest": prefix + other, **extra}
        for one, other in zip(_STATES, following, strict=True)
    ]


def sending(model: Model) -> Callable[[int], None]:
    """Return what sends a number of events by the bound trigger, the quickest way there is."""
    go = model.go

    def run(number: int) -> None:
        for _ in range(number):
            go()

    return run


def joining(machine: Any) -> Callable[[], Model]:
    """Return what makes one more model of a machine."""

    def one() -> Model:
        model = Model()
        machine.add_model(model)
        for _ in range(FIRST_EVENTS):
            model.go()
        return model

    return one


def _machine(model: Any, chart: str) -> Machine:
    if chart not in ("cycle", "guarded"):
        raise Unsupported("no clock" if chart == "timed" else "flat only")
    return Machine(
        model,
        states=_STATES,
        transitions=transitions(chart),
        initial="a",
        auto_transitions=False,
        queued=True,
        send_event=True,
    )


def make(chart: str) -> Bench:
    """Return a chart, running."""
    model = Model()
    _machine(model, chart)
    return Bench(sending(model), lambda: reached([model.state], model.count if chart == "guarded" else None))


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more model of the same machine."""
    return joining(_machine(None, chart))
