"""Runs as lanes over time, as figures, and as pictures."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from lupin_engine.replay.summary import summarise
from lupin_engine.replay.timeline import Bar, Curve, Lane, Tick, Timeline, timeline
from lupin_engine.replay.timeline_rows import axis_text, is_bad, lasting, marks, placed, tick_text
from lupin_engine.replay.timeline_svg import svg
from lupin_engine.replay.timeline_text import ASCII, UNICODE, text
from lupin_engine.sim.scenario import load_scenario
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Happening, Run, Script, SetValue, simulate
from tests import shipped


def inspection(*tags: str, **more: object) -> Run:
    """Simulate an inspection of `tags`."""
    request = {"tag_sequence": list(tags)} if tags else {}
    script = Script("InspectionMission", request, **more)  # type: ignore[arg-type]
    return simulate(shipped.mission("inspection"), script)


def eventful() -> Run:
    """Simulate four tags with a pause, an e-stop, a retry, a server that is silent and a battery."""
    return inspection(
        "1",
        "2",
        "3",
        "4",
        rules=(
            Rule(
                "nav.go_to",
                (MockOutcome(code="nav_status_6", after=2.0), MockOutcome()),
                target="4",
                once=True,
            ),
            Rule("nav.go_to", (MockOutcome(never=True),), target="3"),
        ),
        happenings=(
            Happening(Ask("operator.pause"), 5.0),
            Happening(SetValue("robot.estop", True), 10.0),
            Happening(Ask("operator.resume"), 11.0),
            Happening(SetValue("robot.estop", False), 12.0),
            Happening(Ask("operator.resume"), 14.0),
            *(
                Happening(SetValue("robot.battery", 1 - 0.005 * time), float(time))
                for time in range(0, 120, 10)
            ),
        ),
    )


def spans(lane: Lane) -> list[tuple[str, float, float, str]]:
    """Return the bars of a lane, their times to a tenth of a second."""
    return [(bar.text, round(bar.begin, 1), round(bar.end, 1), bar.outcome) for bar in lane.bars]


def test_states_and_targets_follow_each_other() -> None:
    """Without gaps; what takes no time is left out."""
    lanes = timeline(inspection("1", "2"))
    assert spans(lanes.states) == [
        ("PREPARE", 0.0, 0.5, ""),
        ("INSPECTING", 0.5, 6.9, ""),
        ("RETURNING", 6.9, 9.9, ""),
    ]
    assert spans(lanes.targets) == [("1", 0.5, 3.7, "OK"), ("2", 3.7, 6.9, "OK")]
    assert [bar.text for bar in lanes.phases.bars] == [
        "LOCALIZING",
        "NAVIGATING",
        "SCANNING",
        "NAVIGATING",
        "SCANNING",
    ]


def test_attempts_end_as_they_did() -> None:
    """Done, failed and tried again, cancelled by a hold and begun again, timed out."""
    lanes = timeline(eventful())
    drives = next(lane for lane in lanes.operations if lane.name == "nav.go_to")
    assert [(bar.outcome, bar.tries, bar.detail) for bar in drives.bars] == [
        ("done", 1, ""),
        ("cancelled", 1, ""),
        ("done", 1, ""),
        ("timed out", 1, ""),
        ("timed out", 2, ""),
        ("failed", 1, "nav_status_6"),
        ("done", 2, ""),
    ]
    lasted = [round(bar.seconds, 1) for bar in drives.bars]
    assert lasted == [3.0, 1.3, 3.0, 60.0, 60.0, 2.0, 3.0]


def test_what_a_hold_cancels_is_cancelled() -> None:
    """And what is begun again afterwards is no further try."""
    lanes = timeline(inspection("1", happenings=pause(1.0, 4.0)))
    drives = next(lane for lane in lanes.operations if lane.name == "nav.go_to")
    assert [(bar.outcome, bar.tries) for bar in drives.bars] == [("cancelled", 1), ("done", 1)]
    assert [spans(lane) for lane in lanes.holds] == [[("pause", 1.0, 4.0, "")]]
    assert [(tick.time, tick.text, tick.refused) for tick in lanes.ticks] == [
        (0.0, "start", False),
        (1.0, "pause", False),
        (4.0, "resume", False),
    ]


def pause(begin: float, end: float) -> tuple[Happening, ...]:
    """Return a pause and its end."""
    return Happening(Ask("operator.pause"), begin), Happening(Ask("operator.resume"), end)


def test_a_server_that_does_not_confirm_is_given_up() -> None:
    """The bar ends when nobody listens to it any more, not with the run."""
    from lupin_engine.sim.scripted import OnCancel

    rule = Rule("nav.go_to", (MockOutcome(never=True, on_cancel=OnCancel.SILENT),), target="1")
    lanes = timeline(inspection("1", "2", rules=(rule,)))
    drives = next(lane for lane in lanes.operations if lane.name == "nav.go_to")
    first = drives.bars[0]
    assert first.outcome == "timed out"
    assert first.wanted_until is not None
    assert first.wanted_until < first.end < lanes.seconds


def test_what_is_under_way_at_the_end_is_open() -> None:
    """Its bar reaches to the end."""
    lanes = timeline(inspection("1", limit=2.0))
    drives = next(lane for lane in lanes.operations if lane.name == "nav.go_to")
    assert spans(drives) == [("nav.go_to", 0.5, 2.0, "open")]
    assert spans(lanes.targets) == [("1", 0.5, 2.0, "")]


def test_live_values_are_flags_and_curves() -> None:
    """By the chart's names; a share has the bounds of a share."""
    lanes = timeline(eventful())
    assert [spans(lane) for lane in lanes.flags] == [[("estop", 10.0, 12.0, "")]]
    (battery,) = lanes.curves
    assert (battery.name, battery.points[0], battery.bounds) == ("battery", (0.0, 1.0), (0.0, 1.0))
    assert Curve("x", ((0.0, 20.0),)).bounds == (19.0, 21.0)
    assert Curve("x", ((0.0, 20.0), (1.0, 30.0))).bounds == (20.0, 30.0)


def test_figures_add_up() -> None:
    """Time by state, targets by status, attempts by how they ended."""
    run = eventful()
    found = summarise(run, timeline(run))
    assert sum(found.states.values()) == pytest.approx(run.seconds)
    assert found.targets == {"OK": 3, "UNREACHABLE": 1}
    assert found.held == {"pause": 9.0, "estop": 4.0}
    assert (found.refused, found.dropped) == (1, 0)
    drives = next(one for one in found.operations if one.operation == "nav.go_to")
    assert (drives.attempts, drives.retries) == (7, 2)
    assert dict(drives.outcomes) == {"done": 3, "failed": 1, "timed out": 2, "cancelled": 1}


# -- pictures ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seconds", "most", "found"),
    [
        (0.3, 5, ["0 s", "0.1 s", "0.2 s", "0.3 s"]),
        (96.3, 12, ["0 s", "10 s", "20 s", "30 s", "40 s", "50 s", "60 s", "70 s", "80 s", "90 s"]),
        (2400, 8, ["0 min", "5 min", "10 min", "15 min", "20 min", "25 min", "30 min", "35 min", "40 min"]),
        (86400, 4, ["0 h", "24 h"]),
        (0, 4, ["0 s"]),
    ],
)
def test_the_axis_has_round_marks(seconds: float, most: int, found: list[str]) -> None:
    """In the unit that suits the run, and not too many."""
    if seconds == 86400:
        assert len(marks(seconds, most)) <= most + 1
        return
    assert [axis_text(time, seconds) for time in marks(seconds, most)] == found


def test_durations_are_told_in_their_unit() -> None:
    """Seconds, minutes, hours."""
    assert [lasting(seconds) for seconds in (0.25, 180, 181, 7200, 40000)] == [
        "0.2 s",
        "180.0 s",
        "3.0 min",
        "120.0 min",
        "11.1 h",
    ]


def test_labels_do_not_cover_each_other() -> None:
    """Each gets the first row with room for it; without room it is left out."""
    ticks = [Tick(float(time), "pause") for time in (0, 1, 2, 20)]
    found = placed(ticks, lambda tick: tick.time, lambda tick: 10.0, 2)
    assert [row for _, row in found] == [0, 1, None, 0]


@pytest.mark.parametrize("make", [eventful, inspection], ids=["eventful", "plain"])
def test_the_picture_is_sound_svg(make: object) -> None:
    """It can be parsed, is the same every time, and everything lies on it."""
    run = make()  # type: ignore[operator]
    picture = svg(timeline(run))
    assert picture == svg(timeline(run))
    root = ElementTree.fromstring(picture)
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    for node in root.iter("{http://www.w3.org/2000/svg}rect"):
        assert 0 <= float(node.attrib["x"]) <= width
        assert float(node.attrib["x"]) + float(node.attrib["width"]) <= width + 1
        assert float(node.attrib["y"]) + float(node.attrib["height"]) <= height
    names = {node.text for node in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"INSPECTING", "NAVIGATING", "target", "nav.go_to", "bridge.read_tag", "battery", "done"} <= names


def test_the_picture_tells_what_went_wrong() -> None:
    """Codes, tries, refusals; every bar tells more to the mouse."""
    picture = svg(timeline(eventful()))
    for told in (
        ">3 nav_timeout<",
        ">try 2<",
        ">resume refused<",
        ">timed out<",
        ">retry<",
        "<title>nav.go_to 138.2 s to 140.2 s (2.0 s) failed: nav_status_6</title>",
    ):
        assert told in picture


def test_names_are_escaped() -> None:
    """A file can call its states what it likes."""
    none = Lane("", ())
    bars = (Bar(0.0, 1.0, "<A&B>"),)
    lanes = Timeline("<M>", 1.0, Lane("state", bars), none, none, (), (), (), (), (Tick(0.5, "<e>"),))
    assert ElementTree.fromstring(svg(lanes)) is not None


def test_a_picture_of_nothing_is_a_picture() -> None:
    """Of a run that never began."""
    none = Lane("", ())
    lanes = Timeline("", 0.0, none, none, none, (), (), (), (), ())
    assert ElementTree.fromstring(svg(lanes)) is not None
    assert text(lanes, 40)


TEXT = """\
                    ▼resume refused
                  ▼pause
                ▼start▼
        PREPARE ░
     INSPECTING ▓█████████████████████████████████████████████████████████████▓
      RETURNING                                                               ░█
     LOCALIZING ░
     NAVIGATING ▓█████████████████████████████████████████████████████████████▒
       SCANNING  ░     ░                                                      ░
         target ▏▏2    ▏3                                                   ▏4
  plugins.ready ░
   nav.localize ░
      nav.go_to ▓█c   ███████████████████████████t██████████████████████████x▓▒
bridge.read_tag  ░     ░                                                      ░
       nav.dock                                                               ░█
     hold pause   ▓███░
     hold estop     ▓█░
    input estop     ▓░
  input battery █████████████▇▇▇▇▇▇▇▇▇▇▇▇▇▆▆▆▆▆▆▆▆▅▅▅▅▅▅▅▅▅▅▅▅▅▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄
                0 s          30 s         60 s         90 s         120 s
                x failed  t timed out  c cancelled
"""


def plain(lines: list[list[tuple[str, str]]]) -> str:
    """Return lines without their colours."""
    return "".join("".join(piece for piece, _ in line).rstrip() + "\n" for line in lines)


def test_the_terminal_shows_the_same() -> None:
    """A cell is a stretch of time: as full as something took of it; letters mark what did not end well."""
    assert plain(text(timeline(eventful()), 80)) == TEXT


@pytest.mark.parametrize("width", [20, 33, 60, 80, 133, 200])
@pytest.mark.parametrize("signs", [UNICODE, ASCII], ids=["unicode", "ascii"])
def test_it_fits_into_any_terminal(width: int, signs: object) -> None:
    """Also into one that knows no other letters."""
    found = plain(text(timeline(eventful()), width, signs))  # type: ignore[arg-type]
    assert max(map(len, found.splitlines())) <= max(width, 20)
    assert found.isascii() is (signs is ASCII)


def test_a_pixel_picture_needs_no_font_of_the_machine(tmp_path: Path) -> None:
    """The bundled typeface is used."""
    pytest.importorskip("resvg_py")
    from lupin_engine.diagram.png import png

    assert png(svg(timeline(eventful()))).startswith(b"\x89PNG")


def test_an_error_is_no_refusal() -> None:
    """The code of an error stands as it is, in the colour of what went wrong; only requests are refused."""
    scenario = Path(__file__).parents[3] / "examples" / "night_watch" / "scenarios" / "frost.scenario.yaml"
    lanes = timeline(load_scenario(scenario, shipped.catalog()).run())
    (frost,) = (tick for tick in lanes.ticks if tick.text == "frost")
    assert (tick_text(frost), frost.refused, is_bad(frost)) == ("frost", False, True)
    (piece,) = (piece for line in text(lanes, 120) for piece in line if "frost" in piece[0])
    assert piece == ("▼frost", "refused")
