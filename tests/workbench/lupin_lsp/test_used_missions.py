"""A mission that another one uses as a part: offered, described, found and renamed as a part is."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under, references
from lupin_lsp.places import definition
from lupin_lsp.rename import apply, rename

EVENING = """\
mission: Evening
summary: Two rounds.
request:
  tag_sequence: {type: list of tag, default: "${ tags.numeric_order() }"}
initial: FIRST
states:
  FIRST:
    use: inspection
    with: {tag_sequence: "${ request.tag_sequence }"}
    on_done: SECOND
  SECOND: {use: inspection, on_done: done}
  done: {type: final}
"""


@pytest.fixture
def evening(own_folder: Folder) -> Folder:
    """A folder with a mission that uses the inspection twice, and an inspection that listens everywhere."""
    (own_folder.path / "evening.yaml").write_text(EVENING, encoding="utf-8")
    inspection = own_folder.path / "inspection.yaml"
    text = inspection.read_text(encoding="utf-8")
    heard = "on:\n  operator.skip_current: {target: INSPECTING, guard: len(request.tag_sequence) > 0}\n"
    inspection.write_text(f"{text}{heard}", encoding="utf-8")
    own_folder.touch()
    assert own_folder.survey() == {}
    return own_folder


def at(folder: Folder, name: str, marked: str) -> tuple[Path, int]:
    """Return the place of a `|` in a piece of a file."""
    path = folder.path / name
    return path, folder.text(path).index(marked.replace("|", "", 1)) + marked.index("|")


def offered(folder: Folder, old: str, new: str) -> list[str]:
    """Return what is offered at a `|` that is typed into the evening."""
    path = folder.path / "evening.yaml"
    text = folder.text(path).replace(old, new, 1)
    folder.put(path, text.replace("|", "", 1))
    return [offer.label for offer in complete(folder, path, text.index("|")).found]


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("use: inspection\n", "use: |\n", ["inspection", "visit_targets"]),
        ("{use: inspection, on_done: done}", "{use: inspection, with: {|}}", ["tag_sequence"]),
        ("on_done: SECOND", "on_done: |", ["FIRST", "SECOND", "done"]),
    ],
)
def test_what_is_offered(evening: Folder, old: str, new: str, wanted: list[str]) -> None:
    """Missions beside the parts, the fields of the request, and no state of the mission that is used."""
    found = offered(evening, old, new)
    assert found[: len(wanted)] == wanted
    assert "INSPECTING" not in found


@pytest.mark.parametrize(
    ("marked", "said", "declared"),
    [
        (
            "use: inspec|tion\n",
            "mission InspectionMission",
            "mission: InspectionMission",
        ),
        ("with: {tag_seq|uence", "request.tag_sequence: list of tag", "tag_sequence:"),
    ],
)
def test_what_is_said_and_where_it_is_declared(
    evening: Folder, marked: str, said: str, declared: str
) -> None:
    """In the file of the mission that is used."""
    path, offset = at(evening, "evening.yaml", marked)
    told = hover(evening, path, offset)
    assert told is not None
    assert said in told.text
    mention = mention_under(evening, path, offset)
    assert mention is not None
    (place,) = definition(evening, path, mention)
    text = place.file.read_text(encoding="utf-8")
    line = text.splitlines()[text.count("\n", 0, place.start)]
    assert (place.file.name, line.strip()) == ("inspection.yaml", declared)


@pytest.mark.parametrize(
    ("name", "marked", "wanted"),
    [
        ("evening.yaml", "with: {tag_seq|uence", ["evening.yaml", "inspection.yaml"]),
        ("evening.yaml", "request.tag_seq|uence", ["evening.yaml"]),
        ("inspection.yaml", "mission: Inspection|Mission", ["evening.yaml", "inspection.yaml"]),
    ],
)
def test_every_mention_is_found(evening: Folder, name: str, marked: str, wanted: list[str]) -> None:
    """A field belongs to its mission: that of the user is another one, though it is called the same."""
    path, offset = at(evening, name, marked)
    mention = mention_under(evening, path, offset)
    assert mention is not None
    assert sorted({found.file.name for found in references(evening, path, mention)}) == wanted


def test_a_state_has_one_text_however_often_it_is_used(evening: Folder) -> None:
    """It is renamed once, also where the mission says what it does in all its states."""
    path, offset = at(evening, "inspection.yaml", "target: INSPECT|ING")
    changed = {
        file: apply(evening.text(file), e) for file, e in rename(evening, path, offset, "WALK").items()
    }
    assert list(changed) == [path]
    assert changed[path].count("WALK") == 3
    assert "INSPECTING" not in changed[path]


def test_what_is_wrong_in_a_use_is_told_as_it_is_typed(evening: Folder) -> None:
    """At the use."""
    path = evening.path / "evening.yaml"
    evening.put(path, EVENING.replace("{tag_sequence:", "{tag_sequnce:"))
    (found,) = evening.check(path)
    assert (found.place.line, found.problem, found.hint) == (
        9,
        "unknown field of the request 'tag_sequnce'",
        "did you mean 'tag_sequence'?",
    )
