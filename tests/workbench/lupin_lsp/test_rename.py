"""Renaming states: everywhere, or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_lsp.folder import Folder
from lupin_lsp.rename import Refused, apply, rename

MORE = """\
mission: Other
summary: It has a state of the same name as the inspection.
initial: PREPARE
states:
  PREPARE:
    after: {1 s: done}
  done: {type: final}
"""


def ask(folder: Folder, name: str, marked: str, new: str) -> dict[str, list[str]]:
    """Rename what a `|` marks; return the lines that change, by file."""
    path = folder.path / name
    offset = folder.text(path).index(marked.replace("|", "", 1)) + marked.index("|")
    edits = rename(folder, path, offset, new)
    changed = {file: apply(folder.text(file), found) for file, found in edits.items()}
    after = folder.inspect_with(changed)
    assert after.found == ()
    return {file.name: differences(folder.text(file), text) for file, text in changed.items()}


def differences(before: str, after: str) -> list[str]:
    """Return the lines of `after` that are new, without what surrounds them."""
    pairs = zip(before.splitlines(), after.splitlines(), strict=True)
    return [new.strip() for old, new in pairs if old != new]


@pytest.mark.slow
def test_in_expressions_and_targets(folder: Folder) -> None:
    """in_state, targets, the state itself."""
    assert ask(folder, "lifecycle.yaml", "target: |RETURNING", "HOMING") == {
        "lifecycle.yaml": [
            "engage_guard: in_state('MISSION') or in_state('HOMING')",
            "target: HOMING",
            "target: HOMING",
            "- target: HOMING",
            "target: HOMING",
            "HOMING:",
        ]
    }


def test_across_files(folder: Folder) -> None:
    """A state of a mission that the lifecycle asks for."""
    assert ask(folder, "lifecycle.yaml", "in_state('PRE|PARE')", "GETTING_READY") == {
        "lifecycle.yaml": ["- {refuse: not_localized, guard: in_state('GETTING_READY')}"],
        "inspection.yaml": ["initial: GETTING_READY", "GETTING_READY:"],
    }


def test_one_word_of_a_name_with_dots(folder: Folder) -> None:
    """The state in it, or the one around it."""
    assert ask(folder, "parts/visit_targets.yaml", "target: SCANNING.REA|DING", "MEASURING") == {
        "visit_targets.yaml": ["- target: SCANNING.MEASURING", "on_done: MEASURING", "MEASURING:"]
    }
    assert ask(folder, "parts/visit_targets.yaml", "  SCANN|ING:", "LOOKING") == {
        "visit_targets.yaml": [
            "- {target: LOOKING.CONFIRMING, guard: param.require_visual_confirmation}",
            "- target: LOOKING.READING",
            "LOOKING:",
        ]
    }


def test_whose_answers_are_used(folder: Folder) -> None:
    """`use: READY` names a state."""
    found = ask(folder, "lifecycle.yaml", "  READ|Y:", "IDLE")
    assert "mission.start: {use: IDLE}          # the same answers as READY" in found["lifecycle.yaml"]


REFUSALS = {
    "no state": ("lifecycle.yaml", "do: nav.do|ck", "X", "only states can be renamed; this is none"),
    "no name": (
        "lifecycle.yaml",
        "  READ|Y:",
        "a b",
        "'a b' cannot be the name of a state; use letters, digits and underscores",
    ),
    "taken": ("lifecycle.yaml", "  READ|Y:", "MISSION", "there is a state 'MISSION' already"),
    "the engine's": ("lifecycle.yaml", "target: FAU|LT", "BROKEN", "the engine knows 'FAULT' by its name"),
    "a mission": (
        "inspection.yaml",
        "mission: Inspec|tionMission",
        "X",
        "only states can be renamed; this is none",
    ),
    "history": (
        "lifecycle.yaml",
        "MISSION.his|tory",
        "X",
        "'history' is made by the key 'history', and not a state that can be renamed",
    ),
    "hidden by another": (
        "lifecycle.yaml",
        "target: RETURN|ING",
        "PREPARE",
        "with the name 'PREPARE' an in_state would ask for another state",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refuses(case: str, folder: Folder) -> None:
    """With the reason, and nothing is changed."""
    name, marked, new, reason = REFUSALS[case]
    with pytest.raises(Refused) as refused:
        ask(folder, name, marked, new)
    assert str(refused.value) == reason


def test_refuses_what_would_hide_another_state(folder: Folder) -> None:
    """The place where the name would begin to mean something else is told."""
    with pytest.raises(Refused) as refused:
        ask(folder, "lifecycle.yaml", "  READ|Y:", "INSPECTING")
    meant = "'INSPECTING' means 'MISSION.InspectionMission.INSPECTING' here, which hides 'INSPECTING'"
    assert str(refused.value) == f"this would make a new warning: inspection.yaml:28: {meant}"


def test_refuses_while_a_file_cannot_be_read(folder: Folder) -> None:
    """Half of the mentions could be missed."""
    path = folder.path / "inspection.yaml"
    folder.put(path, folder.text(path) + "\n  }")
    folder.refresh()
    with pytest.raises(Refused) as refused:
        ask(folder, "lifecycle.yaml", "  READ|Y:", "IDLE")
    assert str(refused.value) == "a file of this folder cannot be read; mend that first"


def test_refuses_a_mention_that_means_two_states(own_folder: Folder) -> None:
    """in_state asks by the end of the name: renaming one of them would lose it."""
    (own_folder.path / "other.yaml").write_text(MORE, encoding="utf-8")
    own_folder.touch()
    own_folder.refresh()
    with pytest.raises(Refused) as refused:
        ask(own_folder, "inspection.yaml", "  PREP|ARE:", "BEGIN")
    assert str(refused.value) == (
        "'PREPARE' in lifecycle.yaml:93 also means another state; change that by hand"
    )


def test_a_state_of_a_part_that_is_used_twice(own_folder: Folder) -> None:
    """One text, two states: it is renamed once."""
    path = Path(own_folder.path / "inspection.yaml")
    text = own_folder.text(path).replace(
        "    on_done: done",
        "    on_done: AGAIN\n  AGAIN:\n    itinerary: {items: \"${ request.tag_sequence }\"}\n"
        "    use: visit_targets\n    on_done: done",
    )  # fmt: skip
    path.write_text(text, encoding="utf-8")
    own_folder.touch()
    own_folder.refresh()
    found = ask(own_folder, "parts/visit_targets.yaml", "  NAVI|GATING:", "DRIVING")
    assert found["visit_targets.yaml"][0].startswith("- {target: DRIVING, guard: itinerary.open}")
    assert len(found["visit_targets.yaml"]) == 4
