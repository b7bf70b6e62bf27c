"""Pictures that a run has coloured."""

from __future__ import annotations

from collections import Counter

import pytest

from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.picture import Picture, Tone
from lupin_engine.diagram.svg import svg
from lupin_engine.diagram.trace import Counts, check_fits, coloured
from lupin_engine.errors import UsageError
from tests.lupin_engine.diagram import pictured

ENTERED = ("BOOT", "READY", "MISSION", "MISSION.InspectionMission", "RETURNING", "MISSION")
TAKEN = ("BOOT.on_done.0", "READY.on.mission.start.1", "MISSION.on.operator.abort.0")


def run() -> Picture:
    """The inspection, coloured by those steps."""
    return coloured(
        outline(pictured.chart("inspection")), Counts(Counter(ENTERED), Counter(TAKEN), "two starts")
    )


def test_states_and_ways_have_their_counts_and_tones() -> None:
    """What was never visited is pale."""
    picture = run()
    boxes = {box.name: (box.count, box.tone) for box in picture.every()}
    assert boxes["MISSION"] == (2, Tone.VISITED)
    assert boxes["FAULT"] == (0, Tone.NEVER)
    arrow = next(a for a in picture.arrows if (a.source, a.target) == ("MISSION", "RETURNING"))
    assert arrow.tone is Tone.VISITED
    assert [(label.event, label.count) for label in arrow.labels] == [
        ("done", 0),
        ("abort", 1),
        ("dock", 0),
        ("battery low", 0),
    ]
    never = next(a for a in picture.arrows if (a.source, a.target) == ("BOOT", "FAULT.LATE"))
    assert never.tone is Tone.NEVER
    assert str(arrow.labels[1]).endswith("\u00d71")


def test_the_picture_says_what_it_was_coloured_by() -> None:
    """With counts, in words that can be selected."""
    text = svg(run())
    assert ">two starts</text>" in text
    assert ">\u00d72</text>" in text


def test_counts_of_several_runs_colour_as_well() -> None:
    """A report on coverage has counts of its own."""
    picture = coloured(outline(pictured.chart("inspection")), Counts({"BOOT": 300}, {}))
    assert picture.run == "visited"
    assert next(box for box in picture.every() if box.name == "BOOT").text[-1] == "\u00d7300"


def test_a_run_of_another_mission_is_refused() -> None:
    """It would be a picture of nothing."""
    picture = outline(pictured.chart("inspection"))
    with pytest.raises(UsageError) as caught:
        check_fits(picture, Counts({"BOOT": 1, "MISSION.Other": 1}, {}), "run.json")
    assert str(caught.value) == (
        "'run.json' is a run of another mission: InspectionMission has no state 'MISSION.Other'"
    )
