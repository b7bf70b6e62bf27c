"""Profiles: verified when a catalog is made, and chosen by the lifecycle where there are several."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import LupinError, PluginError
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.profile import NO_PROFILE, OperatorRequest, Profile, Stages, TargetOutcome, Terminal
from lupin_engine.plugin.registry import Catalog, build_catalog, load_catalog
from lupin_greenhouse.profile import PROFILE
from lupin_ros.service.messages import wire_of

OTHER = Profile(
    "other",
    "Another robot.",
    outcomes=(TargetOutcome("TAKEN", "taken", "taken"),),
    requests={"abort": OperatorRequest("It ends.")},
)
LIFECYCLE = """\
lifecycle: small
{profile}initial: WAIT
states:
  WAIT:
    on:
      mission.start: MISSION
  MISSION:
    slot: mission
    on_done: WAIT
  FAULT: {{}}
"""
MISSION = "mission: M\ninitial: A\nstates:\n  A: {after: {1 s: done}}\n  done: {type: final}\n"


def profile_of(folder: Path, line: str, catalog: Catalog) -> tuple[str, list[str]]:
    """Return the profile of a chart whose lifecycle has this line, and what is told of it."""
    (folder / "lifecycle.yaml").write_text(LIFECYCLE.format(profile=line), encoding="utf-8")
    (folder / "m.yaml").write_text(MISSION, encoding="utf-8")
    chart, found = check_chart(folder / "lifecycle.yaml", [folder / "m.yaml"], catalog)
    told = [f"{d.rule}: {d.problem}; {d.hint}" for d in found]
    return chart.profile.name if chart else "", told


def test_the_only_profile_need_not_be_named(tmp_path: Path) -> None:
    assert profile_of(tmp_path, "", build_catalog([], [OTHER])) == ("other", [])


def test_of_several_profiles_the_lifecycle_names_one(tmp_path: Path) -> None:
    """None is better than the wrong one: outcomes and messages hang on it."""
    both = build_catalog([], [PROFILE, OTHER])
    assert both.profile is NO_PROFILE
    assert profile_of(tmp_path, "profile: other\n", both) == ("other", [])
    assert profile_of(tmp_path, "profile: greenhouse\n", both) == ("greenhouse", [])
    several = "missing-key: several profiles are installed: greenhouse, other; write 'profile: NAME'"
    assert profile_of(tmp_path, "", both) == ("", [several])


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("", "several profiles are installed: greenhouse, other"),
        ("profile: else\n", "unknown profile 'else'"),
    ],
)
def test_without_its_profile_a_mission_has_no_other_errors(tmp_path: Path, line: str, problem: str) -> None:
    """Requests, outcomes and actions that only the profile has would each be unknown."""
    missions, installed = default_missions_folder(), load_catalog()
    lifecycle = tmp_path / "lifecycle.yaml"
    text = (missions / "lifecycle.yaml").read_text(encoding="utf-8")
    lifecycle.write_text(text.replace("profile: greenhouse\n", line), encoding="utf-8")
    shutil.copytree(missions / "parts", tmp_path / "parts")
    both = build_catalog(installed.plugins.values(), [PROFILE, OTHER])
    chart, found = check_chart(lifecycle, [missions / "inspection.yaml"], both)
    assert chart is None
    assert [told.problem for told in found] == [problem]


def test_two_profiles_of_one_name_are_refused() -> None:
    with pytest.raises(PluginError, match=r"^profile 'other' is installed twice; uninstall one$"):
        build_catalog([], [OTHER, OTHER])


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"name": "The Other"}, "profile 'The Other': the name must be lower case letters"),
        ({"outcomes": (*OTHER.outcomes, *OTHER.outcomes)}, "outcome 'TAKEN' is there twice"),
        ({"requests": {"go home": OperatorRequest("")}}, "operator's request 'go home': the name must be"),
        ({"requests": {"start": OperatorRequest("")}}, "verb 'start' is there twice"),
        ({"requests": {"go": OperatorRequest("", key="Go")}}, "key 'Go': the name must be one lower case"),
        (
            {"requests": {"go": OperatorRequest("", key="g"), "halt": OperatorRequest("", key="g")}},
            "key 'g' is there twice",
        ),
        ({"publications": PROFILE.publications}, "publish.reading publishes an unknown outcome 'OK'"),
        ({"terminal": Terminal(gauges={"tank": "empty"})}, "gauge 'tank' names an unknown flag 'empty'"),
        ({"abort": "abrot"}, "abort names an unknown request 'abrot'; did you mean 'abort'?"),
        ({"resume": "go_on"}, "resume names an unknown request 'go_on'"),
    ],
)
def test_a_profile_that_contradicts_itself_is_refused(changed: dict[str, Any], problem: str) -> None:
    with pytest.raises(PluginError) as caught:
        build_catalog([], [replace(OTHER, **changed)])
    assert problem in str(caught.value)


def test_a_mission_is_under_way_in_every_state_that_is_not_idle() -> None:
    """Also on the way home, and in states that nobody has heard of."""
    stages = Stages(("BOOT",), ("READY",), ("RETURNING",), ("DONE",), ("FAULT",))
    assert stages.without_mission == {"BOOT", "READY", "DONE", "FAULT"}
    assert stages.over == {"DONE", "FAULT"}
    assert stages.anchors == {"BOOT", "DONE", "FAULT"}


@pytest.mark.parametrize(
    ("profile", "reason"),
    [(NO_PROFILE, "no profile is installed"), (OTHER, "the profile 'other' has no wire")],
)
def test_what_has_no_wire_is_not_run(profile: Profile, reason: str) -> None:
    with pytest.raises(LupinError, match=f"^{reason}: its missions can be simulated, but not run$"):
        wire_of(profile)
