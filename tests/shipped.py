"""The shipped missions and the installed plugins, loaded once for all tests that use them."""

from __future__ import annotations

from functools import cache

from lupin_engine.chart.model import Chart
from lupin_engine.missions.folders import default_missions_folder, lifecycle_of
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import Catalog, load_catalog


@cache
def catalog() -> Catalog:
    """Return what the installed plugins offer."""
    return load_catalog()


@cache
def mission(name: str) -> Chart:
    """Return a shipped mission, by the name of its file."""
    file = default_missions_folder() / f"{name}.yaml"
    return load_chart(lifecycle_of(file), [file], catalog())
