"""The library as it is, over our layout: it chooses transitions and resolves them by itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from transitions.extensions.nesting import NestedTransition

from lupin_engine.chart.expressions.evaluation import Value
from lupin_engine.chart.model import Chart
from lupin_engine.machine.structure import ChartModel, ChartTransition, build_machine


class StockModel(ChartModel):
    """What the stock machine moves; it notes the callbacks that it gets."""

    def __init__(self) -> None:
        super().__init__(None)
        self.heard: list[str] = []

    def note(self, text: str) -> Any:
        """Return a callback that notes `text`."""
        return lambda *_: self.heard.append(text)


def stock_model(given: Chart) -> StockModel:
    """Return a model in the initial states of a chart; guards find the environment in an event's keywords."""
    machine, model = build_machine(given), StockModel()
    for event in machine.events.values():
        for source, transitions in event.transitions.items():
            event.transitions[source] = [_as_stock(cast(ChartTransition, one)) for one in transitions]
    machine.add_model(model)
    return model


def _as_stock(ours: ChartTransition) -> NestedTransition:
    guard = ours.rule.guard
    # The type hints of the library know no list of conditions, and no transition without a target.
    conditions: Any = [_condition(guard)] if guard else None
    return NestedTransition(ours.source, cast(str, ours.dest), conditions)


def _condition(guard: Value) -> Callable[[Any], bool]:
    return lambda event_data: bool(guard.evaluate(event_data.kwargs["environment"]))
