"""With several profiles installed an editor offers the words of the one that the lifecycle names."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.plugin.profile import OperatorRequest, Profile, TargetOutcome
from lupin_engine.plugin.registry import build_catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder

PROFILES = [
    Profile(
        name,
        "",
        outcomes=(TargetOutcome(outcome, outcome.lower(), outcome.lower()),),
        requests={request: OperatorRequest("")},
    )
    for name, outcome, request in (("warehouse", "PICKED", "call_off"), ("ferry", "LANDED", "turn_back"))
]
LIFECYCLE = """\
lifecycle: small
profile: {}
initial: IDLE
states:
  IDLE:
    on:
      mission.start: WORKING
  WORKING:
    slot: mission
    on_done: IDLE
"""
MISSION = """\
mission: Tour
initial: GOING
states:
  GOING:
    itinerary: {items: "${ ['1'] }"}
    after:
      1 s:
        target: done
        do:
          - itinerary.close: {status: }
  done: {type: final}
"""


@pytest.mark.parametrize(("profile", "outcome"), [("warehouse", "PICKED"), ("ferry", "LANDED")])
def test_outcomes_are_those_of_the_lifecycles_profile(tmp_path: Path, profile: str, outcome: str) -> None:
    """And of no other."""
    (tmp_path / "lifecycle.yaml").write_text(LIFECYCLE.format(profile))
    mission = tmp_path / "tour.yaml"
    mission.write_text(MISSION)
    folder = Folder(tmp_path, build_catalog([], PROFILES))
    folder.survey()
    assert folder.catalog.profile.name == profile
    offered = complete(folder, mission, MISSION.index("status: }") + len("status: "))
    assert [item.label for item in offered.found] == [outcome]
