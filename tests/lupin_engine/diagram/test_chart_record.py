"""The chart as the orchestrator tells it: what the picture, the places and the files say fits together."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder, lifecycle_in, mission_files
from lupin_engine.missions.load import LoadedMissions, load_files
from lupin_ros.service.chart_record import chart_picture, chart_record
from tests import shipped

ROOT = Path(__file__).parents[3]
EXAMPLES = sorted((ROOT / "examples").glob("*/missions"))
MISSIONS = mission_files(default_missions_folder())
FILES = [*([file] for file in MISSIONS), MISSIONS, *map(mission_files, EXAMPLES)]


@pytest.fixture(params=FILES, ids=lambda files: "+".join(file.stem for file in files))
def loaded(request: pytest.FixtureRequest) -> LoadedMissions:
    """Return each of the missions, both together, and the examples."""
    files: list[Path] = request.param
    return load_files(lifecycle_in(files[0].parent), files, shipped.catalog())


@pytest.mark.slow
def test_the_ids_of_the_picture_are_those_that_are_told(loaded: LoadedMissions) -> None:
    """Every state is drawn; every transition is, but for refusals and those of the root."""
    told, picture = chart_record(loaded), chart_picture(loaded)
    assert (told["svg"], picture["problem"]) == ("", "")
    root = ElementTree.fromstring(picture["svg"])
    drawn = [e.attrib["data-state"] for e in root.iter() if "data-state" in e.attrib]
    assert sorted(drawn) == sorted(state["id"] for state in told["states"].values())
    assert set(told["states"]) == set(loaded.chart.states) - {""}
    ways = [id for e in root.iter() for id in e.get("data-transition", "").split()]
    assert len(ways) == len(set(ways))
    rules = {r.id: r for s in loaded.chart.states.values() for r in (*s.transitions, *s.resume_at)}
    assert set(told["transitions"]) == set(rules)
    # The root has no box, so no arrow leaves it.
    assert set(ways) == {name for name, rule in rules.items() if rule.refuse is None and rule.source}


def test_every_place_is_in_a_file_that_is_told(loaded: LoadedMissions) -> None:
    """By names that mean the same on every computer; a state's own name stands in its line."""
    told = chart_record(loaded)
    lines = {name: text.splitlines() for name, text in told["files"].items()}
    for name, state in told["states"].items():
        line = lines[state["file"]][state["line"] - 1]
        assert name.rpartition(".")[2] in line, (name, line)
    assert all(lines[way["file"]][way["line"] - 1].strip() for way in told["transitions"].values())
    assert str(ROOT) not in json.dumps(told)
    assert told["hash"] == loaded.hash
