"""What a picture shows of a chart: every word that a reader of the mission would ask about."""

from __future__ import annotations

import pytest

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.model import Kind
from lupin_engine.diagram.descriptions import ElementTexts
from lupin_engine.diagram.outline import find_state, outline, readable_depth
from lupin_engine.diagram.picture import Arrow, Picture, StateBox, Tone, TransitionCause
from lupin_engine.errors import Place, UsageError
from lupin_engine.plugin.types import DURATION
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import chart

INSPECTING = "MISSION.InspectionMission.INSPECTING"


@pytest.fixture(scope="module")
def words() -> Picture:
    """The picture of the mission that says everything."""
    return outline(pictured.chart("words"))


@pytest.fixture(scope="module")
def inspection() -> Picture:
    """The picture of the shipped mission."""
    return outline(pictured.chart("inspection"))


def box(picture: Picture, title: str) -> StateBox:
    """A box by its title."""
    return next(box for box in picture.every() if box.title == title)


def arrow(picture: Picture, source: str, target: str) -> Arrow:
    """An arrow by the ends of the names of its boxes."""
    return next(a for a in picture.arrows if a.source.endswith(source) and a.target.endswith(target))


@pytest.mark.parametrize("name", pictured.NAMES)
def test_every_state_is_a_box(name: str) -> None:
    """All but the root, and the state that wraps a mission where it is the only one."""
    given = pictured.chart(name)
    wrappers = {mission.state for mission in given.missions.values()} if len(given.missions) == 1 else set()
    boxes = [box.name for box in outline(given).every()]
    assert sorted(boxes) == sorted(set(given.states) - wrappers - {""})
    assert sorted(b.name for b in outline(given, whole=True).every()) == sorted(set(given.states) - {""})


@pytest.mark.parametrize("name", pictured.NAMES)
def test_every_transition_is_seen_once(name: str) -> None:
    """On an arrow or as a line of text; refusals, what does nothing and what is derived are left out."""
    given = pictured.chart(name)
    picture = outline(given)
    rules = [rule for state in given.states.values() for rule in (*state.transitions, *state.resume_at)]
    wanted = {
        rule.id
        for rule in rules
        if not rule.derived and (rule.target is not None or (rule.actions and rule.refuse is None))
    }
    labels = [label for found in picture.arrows for label in found.labels]
    lines = [*picture.notes, *(line for found in picture.every() for line in found.lines)]
    labels += [line.label for line in lines if line.label]
    assert {id for label in labels for id in label.ids} == wanted


def test_what_is_added_and_removed_is_drawn(words: Picture) -> None:
    """With what it is, where that is written out."""
    assert "entry / add 'T1' to done, add to lately, remove 'no…" in box(words, "RESTING").text


def test_clocks_are_called_by_their_words(words: Picture) -> None:
    """With the time that they wait for; a tick that leads nowhere is a line."""
    labels = [label for found in words.arrows if found.source.endswith("LOOKING") for label in found.labels]
    assert {"after 1 s", "at 06:30"} <= {label.event for label in labels}
    assert {label.cause for label in labels if label.event == "at 06:30"} == {TransitionCause.TIME}
    assert "every 0.2 s / set read" in box(words, "LOOKING").text


def test_a_for_each_shows_its_list_limit_operation_and_ends(words: Picture) -> None:
    """What is begun, for what, how much of it at a time."""
    assert box(words, "READING").text == (
        "for each tag of request.tags, 2 * request.rounds at a time",
        "[tag.x > '1 m']",
        "do / bridge.read_tag ≤ '5 s' if tag.id == 'T1' else param.patience",
        "done / publish.reading, set read",
        "error / set reason, raise seen.something",
    )


def test_an_operation_around_other_states_is_shown(words: Picture) -> None:
    """In the composite state's own text."""
    assert box(words, "STARTING").text == (
        "before a divert: RESTING, within 5 s",
        "do / nav.localize ≤ 10 s",
        "tries: 3",
    )
    assert box(words, "BOTH").text == (
        "do / nav.localize",
        "updated every 1 s",
        "read.failed [event.far] / set reason",
    )
    assert box(words, "toured").text == ("result / set walked",)


def test_an_itinerary_shows_order_and_sweeps(words: Picture) -> None:
    """Above what comes of it."""
    assert box(words, "TOURING").text == (
        "for each of request.tags",
        "smallest distance(input.pose, approach(target)) first",
        "sweeps: request.rounds",
        "once more: SCAN_FAILED",
        "resume → GOING",
    )


def test_what_wraps_the_mission_says_its_words_in_the_slot(words: Picture) -> None:
    """It has no box of its own, but actions and ways."""
    assert box(words, "MISSION: Words").text == (
        "entry / report.clear, report.note",
        "exit / report.summary",
        "abort → done",
    )


def test_ways_of_the_whole_chart_and_holds_are_notes(words: Picture) -> None:
    """They are true in every state."""
    assert [str(note) for note in words.notes] == [
        "nav.* [in_state('FAULT')] / report.clear",
        "hold pause: from pause until resume",
        "hold estop: from estop until resume",
    ]


def test_a_label_says_event_guard_and_actions_and_has_a_cause(words: Picture, inspection: Picture) -> None:
    """Pictures colour by the cause."""
    found = arrow(words, "STARTING", "BOTH").labels
    assert [(str(label), label.cause) for label in found] == [
        ("done", TransitionCause.DONE),
        ("error [error.code in ['late', 'operation_cancelled…]", TransitionCause.ERROR),
        (
            "budget 50 s, diverts included / code slow, if reason == '': reason = 'slow', else: if…",
            TransitionCause.TIME,
        ),
    ]
    skip, advance = (
        arrow(inspection, "SCANNING", "PUBLISHING").labels[0],
        arrow(inspection, "PUBLISHING", "NAVIGATING").labels[0],
    )
    assert (str(skip), skip.cause) == (
        "skip_current / close SKIPPED",
        TransitionCause.OPERATOR,
    )
    said = "[itinerary.remaining > 0 and unreachable < i…] / set unreachable, advance"
    assert (str(advance), advance.cause) == (said, TransitionCause.ALWAYS)
    assert arrow(words, "STARTING", "BOTH").cause is None
    assert arrow(inspection, "READING", "DWELLING").cause is TransitionCause.DONE


def test_no_arrow_crosses_from_region_to_region_or_leads_inwards() -> None:
    """Such ways are lines of text."""
    picture = outline(pictured.chart("regions"))
    assert box(picture, "d").text == ("jump → a",)
    assert box(picture, "WORK").text == ("w → M",)
    assert arrow(picture, "d", "d").labels[0].event == "q"


def test_a_history_leads_to_where_it_begins(words: Picture) -> None:
    """When it says so; it does so without an event."""
    found = arrow(words, "past", "A")
    assert found.labels == ()
    assert box(words, "H*").kind is Kind.HISTORY


# -- less of it -------------------------------------------------------------------------------------------


def test_focus_shows_a_state_its_inside_and_its_greyed_neighbours() -> None:
    """And no way among the neighbours."""
    picture = outline(pictured.chart("inspection"), focus="SCANNING")
    assert picture.title == "InspectionMission: SCANNING"
    assert picture.initial is None
    assert [(b.title, b.tone, len(b.children)) for b in picture.boxes] == [
        ("DRIVING", Tone.PALE, 0),
        ("SCANNING", Tone.PLAIN, 3),
        ("PUBLISHING", Tone.PALE, 0),
    ]
    inside = {b.name for b in picture.boxes[1].below()}
    assert picture.arrows
    assert all({a.source, a.target} & inside for a in picture.arrows)
    assert picture.boxes[0].text == ()


def test_focus_on_what_wraps_the_mission_shows_it() -> None:
    """Then it is what was asked for."""
    picture = outline(pictured.chart("inspection"), focus="InspectionMission")
    shown = [b for b in picture.boxes if b.tone is Tone.PLAIN]
    assert [b.name for b in shown] == ["MISSION.InspectionMission"]


def test_depth_collapses_what_is_deeper() -> None:
    """With how many states that are; their ways begin and end at the box."""
    picture = outline(pictured.chart("inspection"), depth=2)
    assert box(picture, "INSPECTING").text == ("for each of request.tag_sequence", "… 9 states")
    assert box(picture, "PREPARE").more == "… 1 state"
    assert [str(label) for label in arrow(picture, "PREPARE", "FAULT").labels] == ["error"]
    assert all(b.name.count(".") <= 2 for b in picture.every())
    flat = outline(pictured.chart("inspection"), depth=1)
    assert [b.hidden for b in flat.boxes] == [0, 0, 13, 2, 0, 3]
    assert not any(b.children for b in flat.every())


def test_ways_that_say_the_same_are_one_label_of_all() -> None:
    """Of a collapsed state, for example."""
    states = {
        "A": {"states": {"x": {"on": {"go": "B"}}, "y": {"on": {"go": "B"}}}},
        "B": {},
    }
    found = outline(chart(states), depth=1).arrows
    assert [(a.source, a.target, len(a.labels)) for a in found] == [("A", "B", 1)]
    assert len(found[0].labels[0].ids) == 2


def test_a_large_chart_has_a_readable_depth() -> None:
    """A small one needs none."""
    states = {f"S{i}": {"states": {f"T{j}": {"states": {"u": {}}} for j in range(9)}} for i in range(4)}
    assert readable_depth(outline(chart(states))) == 2
    assert readable_depth(outline(pictured.chart("exploration"))) is None
    assert readable_depth(outline(chart({f"S{i}": {} for i in range(50)}))) == 1


@pytest.mark.parametrize("name", ["SCANNING", "INSPECTING.SCANNING", f"{INSPECTING}.SCANNING"])
def test_a_state_is_found_by_the_end_of_its_name(name: str) -> None:
    """As far as it is needed."""
    assert find_state(pictured.chart("inspection"), name) == f"{INSPECTING}.SCANNING"


@pytest.mark.parametrize(
    ("given", "name", "said"),
    [
        ("inspection", "SCANING", "no state 'SCANING' in InspectionMission; did you mean 'SCANNING'?"),
        (
            "knocks",
            "KNOCKING",
            "2 states are called 'KNOCKING'; say which: MISSION.Knocks.FIRST.KNOCKING,"
            " MISSION.Knocks.SECOND.KNOCKING",
        ),
    ],
)
def test_a_state_that_is_not_found_is_answered(given: str, name: str, said: str) -> None:
    """With the nearest spelling, or with all that are called so."""
    with pytest.raises(UsageError) as caught:
        find_state(pictured.chart(given), name)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("seconds", "told"),
    [
        (0.5, "0.5 s"),
        (60.0, "60 s"),
        (90.0, "90 s"),
        (120.0, "2 min"),
        (1800.0, "30 min"),
        (3600.0, "1 h"),
        (5400.0, "90 min"),
        (0.0, "0 s"),
    ],
)
def test_long_durations_are_told_in_minutes_and_hours(seconds: float, told: str) -> None:
    """As far as they are whole ones; 30 min are not 1800 s to anybody."""
    given = Constant(seconds, Place("m.yaml", 1, 1), DURATION)
    assert ElementTexts(pictured.chart("inspection")).duration(given) == told


def test_values_are_told_as_missions_write_them() -> None:
    """A yes or no is `true`, whatever Python calls it; a text keeps its quotes."""
    given = {"due": True, "why": "late", "far": 2.0, "spot": {"x": 1.0, "ok": False}, "all": [True, 3]}
    found = outline(chart({name.upper(): {"entry": ("set", {name: value})} for name, value in given.items()}))
    assert [b.text[0] for b in found.every() if b.text] == [
        "entry / due = true",
        "entry / why = 'late'",
        "entry / far = 2",
        "entry / spot = {x: 1, ok: false}",
        "entry / all = [true, 3]",
    ]
