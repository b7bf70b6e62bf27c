"""Counterexamples that `lupin prove` has written beside missions, shown where they break what was to hold.

They are simulated with what the files say now, so one is gone as soon as the mission is mended.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lupin_engine.chart import Chart
from lupin_engine.errors import Diagnostic, LupinError
from lupin_engine.plugin import Catalog
from lupin_engine.sim import Missions, load_scenario_text
from lupin_verify.breach import counterexamples, shown_by

#: Returns the chart of a mission as it is being edited; None when there are errors.
_ChartOf = Callable[[Path], Chart | None]


class Counterexamples:
    """What was last found of each scenario, so that it is simulated again only when something has changed."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[Chart, str, Diagnostic | None]] = {}

    def found(self, mission: Path, chart_of: _ChartOf, catalog: Catalog) -> list[Diagnostic]:
        """Return a finding for every scenario of a mission that still shows its breach."""
        told = []
        for file, name in counterexamples(mission).items():
            chart, text = chart_of(mission), file.read_text(encoding="utf-8")
            if chart is None:
                continue  # it says what is wrong with it first
            known = self._known.get(file)
            if known is None or known[0] is not chart or known[1] != text:
                known = self._known[file] = chart, text, _shown(file, name, text, chart, catalog)
            told += [known[2]] if known[2] is not None else []
        return told


def _shown(file: Path, name: str, text: str, chart: Chart, catalog: Catalog) -> Diagnostic | None:
    try:
        scenario = load_scenario_text(text, file, _Edited(chart, catalog))
        return shown_by(scenario, name)
    except LupinError:
        return None  # a scenario that says what the mission does not have any more: lupin test tells


class _Edited(Missions):
    """The one mission that is being edited."""

    def __init__(self, chart: Chart, catalog: Catalog) -> None:
        super().__init__(catalog)
        self._chart = chart

    def chart(self, mission: Path) -> Chart:
        """Return its chart."""
        return self._chart
