"""Record types in the editor: completed, described and found, from a mission and from a binding."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.plugin.registry import load_catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under, outline, references
from lupin_lsp.places import definition

RECORDS = Path(__file__).parents[2] / "charts" / "good" / "records"
MISSION = RECORDS / "rounds.yaml"


@pytest.fixture(scope="module")
def folder() -> Folder:
    """The missions with records, looked at once."""
    found = Folder(RECORDS, load_catalog())
    found.survey()
    return found


def at(text: str) -> int:
    """Return the offset of a `|` in a text of the mission."""
    return MISSION.read_text(encoding="utf-8").index(text.replace("|", "")) + text.index("|")


@pytest.mark.parametrize(
    ("place", "file", "line"),
    [
        ("{type: rou|nd, default", "rounds.yaml", "round: {name: text"),
        ("type: list of wa|rd\n", "places.yaml", "ward: {id: text"),
        ("name: text, wards: list of wa|rd, rest", "places.yaml", "ward: {id: text"),
    ],
)
def test_a_type_is_found_where_it_is_declared(folder: Folder, place: str, file: str, line: str) -> None:
    """In the file itself, or in the binding."""
    mention = mention_under(folder, MISSION, at(place))
    assert mention is not None
    (found,) = definition(folder, MISSION, mention)
    assert found.file.name == file
    assert found.file.read_text(encoding="utf-8")[found.start :].startswith(line)
    assert len(references(folder, MISSION, mention)) > 1


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("{type: rou|nd, default", "type round {name: text, wards: list of ward, rest: duration}"),
        ("type: list of wa|rd\n", "type ward {id: text, floor: integer, pose: pose, door: length, beds"),
        ("guard: target.do|or", "target.door: length"),
    ],
)
def test_a_type_is_described_by_its_fields(folder: Folder, place: str, told: str) -> None:
    """Wherever its name stands, and each field where it is read."""
    found = hover(folder, MISSION, at(place))
    assert found is not None
    assert told in found.text


@pytest.mark.parametrize(
    ("place", "offers"),
    [
        ("{type: |round, default", ["round", "ward", "bed", "list of round"]),
        ("guard: target.|door", ["target.beds", "target.door", "target.floor", "target.id", "target.pose"]),
        ("not any([bed.|free", ["bed.free", "bed.number"]),
        ("- {|id: icu", ["id"]),
        ("pose: {|x: 1 m, y: 2 m, yaw: 90 deg}, door: 120 cm", ["x"]),
        ("beds: [{|number: 1", ["number"]),
        ("default: {|name: morning", ["name"]),
    ],
)
def test_types_and_fields_are_offered(folder: Folder, place: str, offers: list[str]) -> None:
    """Those of the file, of its bindings, and of what is read."""
    labels = [offer.label for offer in complete(folder, MISSION, at(place)).found]
    assert set(offers) <= set(labels)


def test_types_stand_in_the_outline(folder: Folder) -> None:
    """With the other declarations."""
    (types,) = [symbol for symbol in outline(folder, MISSION) if symbol.name == "types"]
    assert [child.name for child in types.children] == ["round"]
