"""The charts that pictures are tested with: the shipped missions and the good charts."""

from __future__ import annotations

from functools import cache

from lupin_engine.chart.model import Chart
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder, mission_files
from lupin_engine.missions.load import load_chart
from tests import shipped
from tests.lupin_engine.chart.test_words import GOOD, WORDS, wide_catalog
from tests.lupin_engine.machine.charts import chart as built

SHIPPED = tuple(file.stem for file in mission_files(default_missions_folder()))
MINI = tuple(file.stem for file in sorted(GOOD.glob("*.yaml")))
NAMES = (*SHIPPED, "words", *MINI, "regions")

#: Parallel states within each other, with ways out of them, into them and back to themselves.
REGIONS = {
    "M": {
        "kind": "parallel",
        "states": {
            "WORK": {
                "kind": "parallel",
                "states": {
                    "EXPLORE": {
                        "initial": "a",
                        "states": {"a": {"on": {"x": "b"}}, "b": {"on": {"z": "OUT"}}},
                    },
                    "HARVEST": {
                        "initial": "c",
                        "states": {
                            "c": {"after": {3: "d"}},
                            "d": {"on": {"q": "d", "back": "c", "jump": "EXPLORE.a"}},
                        },
                    },
                },
                "on": {"w": "M"},
            },
            "POWER": {"initial": "ok", "states": {"ok": {"on": {"low": "bad"}}, "bad": {"on_error": "OUT"}}},
        },
        "on": {"stop": "OUT"},
    },
    "OUT": {"on": {"again": "M.WORK.EXPLORE.b", "self": "OUT", "fresh": "M"}},
}


@cache
def chart(name: str) -> Chart:
    """Return a chart by its name."""
    if name in SHIPPED:
        return shipped.mission(name)
    if name == "words":
        return load_chart(WORDS / LIFECYCLE, [WORDS / "words.yaml"], wide_catalog())
    if name == "regions":
        return built(REGIONS)
    return load_chart(GOOD.parent / "mini" / LIFECYCLE, [GOOD / f"{name}.yaml"], wide_catalog())
