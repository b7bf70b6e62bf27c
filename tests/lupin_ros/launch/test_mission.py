"""What is to be run, looked at before anything is started."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.requests import check_request
from lupin_engine.errors import ChartError, UsageError
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog

CATALOG = load_catalog()
SHIPPED = default_missions_folder()


@pytest.mark.parametrize("name", ["inspection", "InspectionMission", str(SHIPPED / "inspection.yaml")])
def test_a_mission_has_three_names(name: str) -> None:
    """Its file's, its own, and its path."""
    loaded = load_missions([name], CATALOG)
    assert loaded.names == ("InspectionMission",)
    assert loaded.parameters() == {
        "missions": [str(SHIPPED / "inspection.yaml")],
        "missions_path": str(SHIPPED),
    }


def test_the_nearest_folder_goes_before_the_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An author's checkout wins over what is installed."""
    shutil.copytree(SHIPPED, tmp_path / "missions")
    monkeypatch.chdir(tmp_path)
    assert load_missions(["inspection"], CATALOG).parameters()["missions_path"] == str(tmp_path / "missions")
    assert "InspectionMission" in load_missions([], CATALOG).names


def test_what_a_binding_calls_brings_the_plugin_that_serves_it() -> None:
    """The tutorial's patrol calls the arm by its service; its nodes are the arm's."""
    patrol = load_missions([str(Path(__file__).parents[3] / "docs" / "tutorial" / "patrol.yaml")], CATALOG)
    assert "arm" not in patrol.chart.plugins
    assert "arm" in patrol.plugins
    assert "perception" not in patrol.plugins


@pytest.mark.parametrize(("kind", "what"), [("values", "seen.tags"), ("events", "seen.tags")])
def test_what_a_binding_reads_brings_the_plugin_that_publishes_it(
    tmp_path: Path, kind: str, what: str
) -> None:
    """The list of discovered tags comes from the aggregator, which no word of this mission names."""
    folder = tmp_path / "missions"
    (folder / "bindings").mkdir(parents=True)
    read = ", type: count, from: '${ len(message.tags) }'" if kind == "values" else ""
    name = what if kind == "values" else what.partition(".")[2]
    topic = "topic: {name: /perception/discovered_tags, type: lupin_msgs/msg/DiscoveredTags}"
    text = f"binding: seen\nsummary: tags\n{kind}:\n  {name}: {{summary: tags, {topic}{read}}}\n"
    (folder / "bindings" / "seen.yaml").write_text(text)
    shutil.copy(SHIPPED / "lifecycle.yaml", folder)
    listens = "on: {seen.tags: done}" if kind == "events" else "always: {target: done, guard: input.seen > 0}"
    inputs = "inputs: {seen: {value: seen.tags, initial: 0}}\n" if kind == "values" else ""
    states = f"initial: A\nstates:\n  A: {{{listens}}}\n  done: {{type: final}}\n"
    (folder / "look.yaml").write_text(f"mission: Look\nsummary: look\n{inputs}{states}")
    loaded = load_missions([str(folder / "look.yaml")], CATALOG)
    assert "perception" not in loaded.chart.plugins
    assert "perception" in loaded.plugins
    assert loaded.heard == {"/perception/discovered_tags": what}


def test_every_error_of_a_mission_is_told(tmp_path: Path) -> None:
    """Two mistakes, two findings, each with its place."""
    folder = tmp_path / "m"
    shutil.copytree(SHIPPED, folder)
    file = folder / "inspection.yaml"
    broken = file.read_text().replace("phase: LOC", "phaze: LOC").replace("on_error: FAULT", "on_error: FALT")
    file.write_text(broken)
    with pytest.raises(ChartError) as found:
        load_missions([str(file)], CATALOG)
    assert [d.rule for d in found.value.diagnostics] == ["unknown-key", "unknown-state"]
    assert all(str(d).startswith(f"{file}:") for d in found.value.diagnostics)


def test_a_request_is_checked_with_the_words_of_the_service() -> None:
    """Unknown tags are found before anything is started; known ones pass."""
    loaded = load_missions(["inspection"], CATALOG)
    check_request(loaded, {}, {"tag_sequence": ["1", "5"]})
    with pytest.raises(UsageError, match=r"^unknown tag '99'; the layout has 29 tags: 1, 2, 3,"):
        check_request(loaded, {}, {"tag_sequence": ["1", "99"]})


@pytest.mark.parametrize(
    ("mission", "tags", "goal", "refusal"),
    [
        (
            "inspection",
            (),
            5,
            "InspectionMission has no use for --goal: its request has no discovery_goal; it has tag_sequence",
        ),
        (
            "exploration",
            ("1",),
            5,
            "ExplorationMission has no use for --tags: its request has no tag_sequence; "
            "it has discovery_goal",
        ),
    ],
)
def test_what_a_mission_cannot_be_asked_for_is_refused(
    mission: str, tags: tuple[str, ...], goal: int, refusal: str
) -> None:
    """The service would ignore it; somebody who types it means something by it."""
    request = {"tag_sequence": list(tags), "discovery_goal": goal}
    with pytest.raises(UsageError) as found:
        check_request(load_missions([mission], CATALOG), {}, request)
    assert str(found.value) == refusal


def test_a_goal_is_a_request_of_the_exploration() -> None:
    """It is taken as it is, 0 stands for the mission's own, and nothing is less than that."""
    loaded = load_missions(["exploration"], CATALOG)
    check_request(loaded, {}, {"discovery_goal": 5})
    check_request(loaded, {}, {"discovery_goal": 0})
    with pytest.raises(UsageError, match="expected count of at least 0, got -1"):
        check_request(loaded, {}, {"discovery_goal": -1})
