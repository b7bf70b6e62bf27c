"""Units in bindings: a number with one is a number of that dimension, as a parameter that is written so."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.bound_catalog import bound_catalog
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.load import LIFECYCLE, check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import DURATION, number_in

MINI = Path(__file__).parents[1] / "charts" / "mini"
AROUND: dict[str, Any] = {"param": {}, "constant": {}, "now": 0.0}
VALUE = """\
binding: scale
summary: The scale.
values:
  scale.weight:
    summary: what lies on it
    type: number
    unit: {unit}
    topic: {{name: /scale, type: std_msgs/msg/Float32}}
    from: ${{ message.data }}
"""
OPERATION = """\
binding: scale
summary: The scale.
codes:
  scale_gone: {label: the scale is gone}
operations:
  tare:
    summary: Set it to zero.
    arguments:
      wait: {type: duration, default: 2, summary: how long it waits}
    service: {name: /scale/tare, type: std_srvs/srv/Trigger}
    done_when: response.success
    code: scale_gone
"""
MISSION = """\
mission: Weigh
states:
  TARING:
    invoke: {do: scale.tare, timeout: {after: 5 s, code: scale_gone}}
    on_done: done
    on_error: done
  done: {type: final}
"""


def write(folder: Path, text: str) -> None:
    """Write a binding beside the missions of a folder."""
    (folder / "bindings").mkdir()
    (folder / "bindings" / "scale.yaml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("unit", "base", "factor"), [("g", "kg", 1e-3), ("kg", "kg", 1.0), ("ml", "l", 1e-3), ("min", "s", 60.0)]
)
def test_a_number_in_a_unit_is_kept_in_its_base(
    tmp_path: Path, catalog: Catalog, unit: str, base: str, factor: float
) -> None:
    """What is in the message is in the unit; missions compare it with quantities."""
    write(tmp_path, VALUE.format(unit=unit))
    findings = Findings()
    bound = bound_catalog([tmp_path], catalog, {}, findings)
    assert bound is not None
    assert findings.all == ()
    assert bound.catalog.values["scale.weight"].type == (DURATION if base == "s" else number_in(base))
    heard = bound.bindings["scale"].values["scale.weight"].heard({"data": 5.0}, AROUND)
    assert heard == {"value": pytest.approx(5.0 * factor)}


def test_a_default_that_is_wrong_is_told_once(tmp_path: Path, catalog: Catalog) -> None:
    """Not once more in each mission that relies on it."""
    shutil.copy(MINI / LIFECYCLE, tmp_path)
    write(tmp_path, OPERATION)
    mission = tmp_path / "weigh.yaml"
    mission.write_text(MISSION, encoding="utf-8")
    _, found = check_chart(tmp_path / LIFECYCLE, [mission], catalog)
    assert [(finding.rule, finding.path) for finding in found] == [
        ("no-unit", "operations.tare.arguments.wait.default")
    ]
