"""Loads the calibration's chart at import: an error in it keeps the node from starting."""

from __future__ import annotations

from pathlib import Path

import lupin_arm.calibration
from lupin_arm.calibration.catalog import PLUGIN
from lupin_engine.chart import Chart
from lupin_engine.missions import LIFECYCLE, load_chart
from lupin_engine.plugin import build_catalog
from lupin_greenhouse import PROFILE

#: Where the chart is written down.
FOLDER = Path(lupin_arm.calibration.__file__).parent

CHART: Chart = load_chart(
    FOLDER / LIFECYCLE, [FOLDER / "calibration.yaml"], build_catalog([PLUGIN], [PROFILE])
)
