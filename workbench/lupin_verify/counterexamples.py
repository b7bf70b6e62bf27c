"""Diagnostics of counterexamples that `lupin prove` has written beside a mission, for editors.

Each is simulated with the edited mission, and again only after a change. One that no longer breaks its
property, or no longer fits the mission, gives none.
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
    """The cached result of each scenario; it is simulated again only after a change of file or chart."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[Chart, str, Diagnostic | None]] = {}

    def found(self, mission: Path, chart_of: _ChartOf, catalog: Catalog) -> list[Diagnostic]:
        """Return a finding for every scenario of a mission that still shows its breach."""
        found = []
        for file, name in counterexamples(mission).items():
            chart, text = chart_of(mission), file.read_text(encoding="utf-8")
            if chart is None:
                continue  # the mission's own errors come first
            known = self._known.get(file)
            if known is None or known[0] is not chart or known[1] != text:
                known = self._known[file] = chart, text, _shown(file, name, text, chart, catalog)
            found += [known[2]] if known[2] is not None else []
        return found


def _shown(file: Path, name: str, text: str, chart: Chart, catalog: Catalog) -> Diagnostic | None:
    try:
        scenario = load_scenario_text(text, file, _Edited(chart, catalog))
        return shown_by(scenario, name)
    except LupinError:
        return None  # the scenario no longer fits the mission; `lupin test` reports it


class _Edited(Missions):
    """The one mission that is being edited."""

    def __init__(self, chart: Chart, catalog: Catalog) -> None:
        super().__init__(catalog)
        self._chart = chart

    def chart(self, mission: Path) -> Chart:
        """Return its chart."""
        return self._chart
