"""A wrong guard is told once: no rule speaks of what it would mean, whatever the chart does around it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog

MINI = Path(__file__).parents[3] / "charts" / "mini"

HEAD = """\
mission: M
params:
  most: {type: count, default: 3}
context:
  laps: {type: count, default: 0}
initial: A
states:
"""
DRIVE = "{do: nav.dock, with: {pose: '${ param.dock_pose }'}, timeout: {after: 5 s, code: late}}"

#: Guards with a mistake.
GUARDS = (
    "laps > param.most && laps < 9",
    "lap > param.most",
    "error.code == 'nav_rejectd' and param.most > laps",
    "nearby(param.most, laps)",
    "len(param.most, laps)",
    ">-\n              laps > 3\n              and param.most > laps.value",
    "itinerary.opn and laps > param.most",
)
#: What stands around a guard.
AROUND = {
    "the only answer to an error": f"""\
  A:
    invoke: {DRIVE}
    on_done: done
    on_error:
      - target: done
        guard: GUARD
  done: {{type: final}}
""",
    "one of several answers": f"""\
  A:
    invoke: {DRIVE}
    on_done: done
    on_error:
      - target: done
        guard: GUARD
      - target: A
        guard: laps < 3
      - target: done
  done: {{type: final}}
""",
    "a circle of 'always'": f"""\
  A:
    invoke: {DRIVE}
    on_done: done
    on_error: B
  B:
    always:
      - target: C
        guard: GUARD
      - target: done
  C: {{always: B}}
  done: {{type: final}}
""",
    "an 'if' among actions": f"""\
  A:
    itinerary: {{items: "${{ tags.numeric_order() }}"}}
    on_done: done
    initial: GOING
    states:
      GOING:
        exit:
          if:
            guard: GUARD
            then: {{itinerary.close: {{status: OK}}}}
            else: {{itinerary.close: {{status: SKIPPED}}}}
        invoke: {DRIVE}
        on_done: NEXT
        on_error: NEXT
      NEXT:
        always:
          - {{target: GOING, guard: itinerary.remaining > 0, do: itinerary.advance}}
          - target: over
      over: {{type: final}}
  done: {{type: final}}
""",
    "a visit that is closed": f"""\
  A:
    itinerary: {{items: "${{ tags.numeric_order() }}"}}
    on_done: done
    initial: GOING
    states:
      GOING:
        invoke: {DRIVE}
        on_done: {{target: NEXT, do: {{itinerary.close: {{status: OK}}}}}}
        on_error:
          - target: NEXT
            guard: GUARD
            do: {{itinerary.close: {{status: SKIPPED}}}}
          - {{target: NEXT, do: {{itinerary.close: {{status: SKIPPED}}}}}}
      NEXT:
        always:
          - target: GOING
            guard: GUARD
            do: {{itinerary.close: {{status: OK}}}}
          - {{target: GOING, guard: itinerary.remaining > 0, do: itinerary.advance}}
          - target: over
      over: {{type: final}}
  done: {{type: final}}
""",
}


@pytest.mark.parametrize("around", AROUND)
@pytest.mark.parametrize("guard", GUARDS)
def test_a_wrong_guard_brings_no_second_finding(
    guard: str, around: str, tmp_path: Path, catalog: Catalog
) -> None:
    """What follows from a guard that nobody has understood is not worth telling."""
    shutil.copy(MINI / LIFECYCLE, tmp_path)
    (tmp_path / "m.yaml").write_text(HEAD + AROUND[around].replace("GUARD", guard))
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert found
    assert [str(d) for d in found if not d.path.endswith(".guard")] == []
