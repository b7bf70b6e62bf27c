"""Pictures show every word that a reader of the mission would ask about."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from lupin_engine.chart.load import LIFECYCLE, load_chart
from lupin_engine.diagram.dot import dot
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import Box, Outline, outline
from tests.chart.test_words import WORDS, wide_catalog


@pytest.fixture(scope="module")
def picture() -> Outline:
    """The picture of the mission that says everything."""
    return outline(load_chart(WORDS / LIFECYCLE, [WORDS / "words.yaml"], wide_catalog()))


def box(picture: Outline, title: str) -> Box:
    """A box by its title."""
    return next(box for top in picture.boxes for box in top.below() if box.title == title)


def test_a_for_each_shows_its_list_limit_operation_and_ends(picture: Outline) -> None:
    """What is begun, for what, how much of it at a time."""
    assert box(picture, "READING").lines == (
        "for each tag of request.tags, 2 * request.rounds at a time",
        "[tag.x > '1 m']",
        "bridge.read_tag ≤ '5 s' if tag.id == 'T1' else param.patience",
        "done / publish.reading, set",
        "error / set, raise",
    )


def test_an_operation_around_other_states_is_shown(picture: Outline) -> None:
    """In the composite state's own text."""
    assert box(picture, "STARTING").lines == ("nav.localize ≤ 10 s", "tries: 3")
    assert box(picture, "BOTH").lines == ("nav.localize",)
    assert 'state "STARTING<br/>nav.localize ≤ 10 s<br/>tries: 3" as STARTING {' in mermaid(picture)
    assert 'label="STARTING\\lnav.localize ≤ 10 s\\ltries: 3\\l"' in dot(picture)


def test_a_budget_labels_its_arrow(picture: Outline) -> None:
    """With the time that the parameters' defaults make."""
    arrow = next(arrow for arrow in picture.arrows if arrow.source.endswith("STARTING"))
    assert arrow.target.endswith("BOTH")
    assert arrow.labels[-1] == "budget 50 s"


def test_an_itinerary_shows_order_and_sweeps(picture: Outline) -> None:
    """Above what comes of it."""
    assert box(picture, "TOURING").lines[:3] == (
        "for each of request.tags",
        "smallest distance(input.pose, approach(target)) first",
        "sweeps: request.rounds",
    )


def test_the_history_of_a_parallel_state_is_no_region(picture: Outline) -> None:
    """It would be drawn beside them, as if something went on there."""
    assert mermaid(picture).count("    --\n") == 1


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not installed")
def test_graphviz_draws_it(picture: Outline) -> None:
    """Graphviz has nothing to complain about."""
    drawn = subprocess.run(["dot", "-Tsvg"], input=dot(picture), capture_output=True, text=True, check=True)
    assert drawn.stderr == ""
