"""Flowers of a scan, fused; and pests that belong to no tag."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse.mission import is_under_way
from lupin_greenhouse.poses import Array
from lupin_perception import anomalies
from lupin_perception.anomalies import AnomalyWatch, Pest
from lupin_perception.boxes import BoxView
from lupin_perception.detections import Detection
from lupin_perception.flowers import (
    NONE,
    ColumnBloom,
    Rules,
    ScanSummary,
    TagScan,
    fuse,
    scanned_tag,
)
from tests import shipped

RULES = Rules(
    view=BoxView(0.5, 0.5),
    columns=7,
    anomaly="bug",
    min_confidence=0.35,
    gated=True,
    margin=0.1,
)
UNGATED = Rules(RULES.view, 7, "bug", 0.35, gated=False, margin=0.1)
#: A camera that sees the whole box at once.
WIDE = Rules(BoxView(0.0, 0.5), 7, "bug", 0.35, gated=True, margin=0.1)
NAMES = st.sampled_from(["tulip_red", "tulip_white", "tulip_pink", "bug"])
DETECTIONS = st.builds(Detection, NAMES, st.sampled_from([0.2, 0.4, 0.6, 0.6, 0.9]), st.floats(-1.0, 1.0))


def red(bearing: float = 0.0, confidence: float = 0.9) -> Detection:
    return Detection("tulip_red", confidence, bearing)


def bug(bearing: float = 0.0, confidence: float = 0.9) -> Detection:
    return Detection("bug", confidence, bearing)


def scan(
    *detections: Detection, pan: float = 0.0, rules: Rules = RULES, width: float | None = None
) -> TagScan:
    made = TagScan(rules)
    made.aim("5", width)
    made.add(detections, pan)
    return made


def summary(
    *detections: Detection, pan: float = 0.0, rules: Rules = RULES, width: float | None = None
) -> ScanSummary | None:
    return scan(*detections, pan=pan, rules=rules, width=width).summary()


def test_a_flower_in_the_middle_is_a_bloom_in_the_middle_column() -> None:
    assert summary(red()) == ScanSummary("tulip_red", 0.9, False, (ColumnBloom(3, "tulip_red", 0.9, False),))


def test_a_pest_is_no_species_and_marks_its_column_only() -> None:
    found = summary(red(-0.9), bug(0.9), red(0.9, 0.5))
    assert found == ScanSummary(
        "tulip_red",
        0.9,
        True,
        (ColumnBloom(1, "tulip_red", 0.9, False), ColumnBloom(5, "tulip_red", 0.5, True)),
    )


def test_a_pest_alone_is_a_bloom_without_a_species() -> None:
    assert summary(bug()) == ScanSummary("", 0.0, True, (ColumnBloom(3, "", 0.0, True),))


def test_the_surest_species_wins_its_column_and_the_box() -> None:
    found = summary(Detection("tulip_white", 0.5, 0.0), Detection("tulip_pink", 0.8, 0.0), red(0.9, 0.6))
    assert found is not None
    assert (found.species, found.confidence) == ("tulip_pink", 0.8)
    assert [bloom.species for bloom in found.blooms] == ["tulip_pink", "tulip_red"]


@pytest.mark.parametrize(("confidence", "counts"), [(0.35, True), (0.34, False)])
def test_what_is_too_unsure_counts_for_nothing(confidence: float, counts: bool) -> None:
    assert (summary(red(confidence=confidence)) is not None) is counts


@given(frames=st.lists(DETECTIONS, max_size=20), order=st.randoms(use_true_random=False))
def test_the_order_of_detections_changes_nothing(frames: list[Detection], order: object) -> None:
    shuffled = list(frames)
    order.shuffle(shuffled)  # type: ignore[attr-defined]
    assert summary(*frames) == summary(*shuffled)


SEEN = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 2), st.floats(0.0, 1.0)), max_size=20)


@given(one=SEEN, other=SEEN)
def test_what_is_fused_in_parts_is_what_is_fused_at_once(
    one: list[tuple[int, int, float]], other: list[tuple[int, int, float]]
) -> None:
    """In either order: each place has the surest that was seen there, and `NONE` where nothing was."""

    def fused(best: Array, seen: list[tuple[int, int, float]]) -> Array:
        columns, kinds = (np.array([entry[axis] for entry in seen], dtype=np.intp) for axis in (0, 1))
        return fuse(best, columns, kinds, np.array([entry[2] for entry in seen]))

    nothing = np.full((7, 3), NONE)
    at_once = fused(nothing, one + other)
    assert np.array_equal(at_once, fused(fused(nothing, other), one))
    assert np.array_equal(at_once, fused(fused(nothing, one), other))
    for column, kind in np.ndindex(7, 3):
        here = [sure for k, s, sure in one + other if (k, s) == (column, kind)]
        assert at_once[column, kind] == max(here, default=NONE)


@given(frames=st.lists(DETECTIONS, max_size=20))
def test_seeing_the_same_again_changes_nothing(frames: list[Detection]) -> None:
    assert summary(*frames, *frames) == summary(*frames)


@given(frames=st.lists(DETECTIONS, max_size=20))
def test_a_summary_is_made_of_its_blooms(frames: list[Detection]) -> None:
    found = summary(*frames)
    if found is None:
        assert all(detection.confidence < 0.35 for detection in frames)
        return
    assert found.anomaly == any(bloom.anomaly for bloom in found.blooms)
    assert found.confidence == max(bloom.confidence for bloom in found.blooms)
    columns = [bloom.column for bloom in found.blooms]
    assert columns == sorted(set(columns))


def test_a_neighbours_bloom_is_not_credited_to_this_box() -> None:
    """War story 50: at pan 1.6 the camera looks past the box. If its width is assumed only, who knows."""
    edge = ScanSummary("tulip_red", 0.9, False, (ColumnBloom(6, "tulip_red", 0.9, False),))
    assert summary(red(), bug(), pan=1.6, width=0.8) is None
    assert summary(red(), pan=1.6, width=0.8, rules=UNGATED) == edge
    assert summary(red(), pan=1.6) == edge


def test_once_the_width_of_the_box_is_known_the_scan_begins_anew() -> None:
    """What was taken in before may be the neighbour's."""
    made = scan(red(), pan=1.6)
    assert made.aim("5", 0.8)
    assert made.summary() is None
    made.add([red(), bug()], 1.6)
    assert made.summary() is None
    assert not made.aim("5", 0.8)


def test_another_tag_begins_with_nothing() -> None:
    """War story 51: a bug seen at the previous pot bled into the next."""
    made = scan(red(), bug())
    assert made.aim("6")
    assert made.summary() is None
    made.add([Detection("tulip_white", 0.5, 0.0)], 0.0)
    found = made.summary()
    assert found is not None
    assert (found.species, found.anomaly) == ("tulip_white", False)


def test_the_same_tag_again_after_none_begins_with_nothing_but_goes_on_otherwise() -> None:
    made = scan(red(), bug())
    assert not made.aim("5")
    assert made.summary() is not None
    made.aim("")
    made.aim("5")
    assert made.summary() is None


def test_without_a_tag_nothing_is_kept() -> None:
    made = TagScan(RULES)
    made.add([red()], 0.0)
    assert made.summary() is None
    made.aim("5")
    assert made.summary() is None


def test_a_scan_goes_on_after_a_restart_and_what_was_told_stays_true() -> None:
    before = summary(red(bearing=-0.9), bug(bearing=-0.9), bug(bearing=0.9, confidence=0.6))
    assert before is not None
    made = TagScan(RULES)
    made.aim("5")
    made.resume(before)
    assert made.summary() == before
    made.add([Detection("tulip_white", 0.5, 0.0)], 0.0)
    found = made.summary()
    assert found is not None
    assert (found.species, found.anomaly, len(found.blooms)) == ("tulip_red", True, 3)


def test_blooms_at_both_edges_are_resumed() -> None:
    before = summary(red(bearing=-1.0), red(bearing=1.0), pan=0.0, rules=WIDE)
    assert before is not None
    assert [bloom.column for bloom in before.blooms] == [0, 6]
    made = TagScan(WIDE)
    made.aim("5")
    made.resume(before)
    assert made.summary() == before


def test_what_is_resumed_by_a_node_of_other_columns_is_left_out() -> None:
    made = TagScan(RULES)
    made.aim("5")
    made.resume(
        ScanSummary(
            "tulip_red", 0.9, True, (ColumnBloom(7, "tulip_red", 0.9, True), ColumnBloom(-1, "", 0.0, True))
        )
    )
    assert made.summary() is None


def test_a_scan_without_an_end_forgets_what_is_not_seen_again() -> None:
    """A robot that is parked for a night: mistakes of the detector must not add up."""
    made = scan(red(), bug(bearing=-0.9))
    made.age()
    made.add([red(confidence=0.7), Detection("a_kind_of_its_own", 0.5, 0.0)], 0.0)
    found = made.summary()
    assert found is not None
    assert (found.confidence, found.anomaly) == (0.9, True), "not at once"
    made.age()
    found = made.summary()
    assert found is not None
    assert (found.species, found.confidence, found.anomaly, len(found.blooms)) == ("tulip_red", 0.7, False, 1)
    made.age()
    assert made.summary() is None


def bloom_at(column: int, species: str = "tulip_red", anomaly: bool = False) -> ColumnBloom:
    return ColumnBloom(column, species, 0.9, anomaly)


@pytest.mark.parametrize(
    ("now", "news"),
    [
        (ScanSummary("tulip_red", 0.9, False, (bloom_at(3),)), False),
        (ScanSummary("tulip_red", 0.99, False, (bloom_at(3),)), False),
        (ScanSummary("tulip_red", 0.75, False, (bloom_at(3),)), True),
        (ScanSummary("tulip_pink", 0.9, False, (bloom_at(3),)), True),
        (ScanSummary("tulip_red", 0.9, True, (bloom_at(3, anomaly=True),)), True),
        (ScanSummary("tulip_red", 0.9, False, (bloom_at(2),)), True),
        (ScanSummary("tulip_red", 0.9, False, (bloom_at(2), bloom_at(3))), True),
    ],
)
def test_what_has_changed_is_news(now: ScanSummary, news: bool) -> None:
    before = ScanSummary("tulip_red", 0.9, False, (bloom_at(3),))
    assert now.adds_to(before) is news
    assert now.adds_to(None)


@pytest.mark.parametrize(
    ("lifecycle", "phase", "tag"),
    [
        ("INSPECTING", "SCANNING", "5"),
        ("MONITORING", "SCANNING", "5"),
        ("PRUNING_BY_NIGHT", "SCANNING", "5"),
        ("MONITORING", "MONITORING_SCANNING", "5"),
        ("INSPECTING", "CONFIRMING", ""),
        ("INSPECTING", "NAVIGATING", ""),
        ("EXPLORING", "SCANNING", ""),
        ("RETURNING", "", ""),
        ("READY", "", ""),
    ],
)
def test_flowers_belong_to_the_target_that_is_scanned_and_to_no_other(
    lifecycle: str, phase: str, tag: str
) -> None:
    assert scanned_tag(lifecycle, phase, "5") == tag


def test_no_mission_is_under_way_in_these_states_only() -> None:
    """War story 64: an idle READY is not a mission. In all others that shipped missions publish, one is."""
    charts = [shipped.mission("inspection"), shipped.mission("exploration")]
    published = {state.label for chart in charts for state in chart.states.values() if state.label.isupper()}
    assert {state for state in published if not is_under_way(state)} == {"BOOT", "READY", "DONE", "FAULT"}


@pytest.mark.parametrize("state", ["PATROLLING", "SPRAYING", "PRUNING_BY_NIGHT"])
def test_a_mission_that_nobody_has_seen_before_is_under_way(state: str) -> None:
    assert is_under_way(state)


def test_nothing_was_heard_of_a_mission_yet() -> None:
    assert not is_under_way("")


# --- pests at no tag


def watch() -> AnomalyWatch:
    return AnomalyWatch("bug", 0.35, 3, 1.0)


def reports(
    made: AnomalyWatch, *frames: list[Detection], x: float = 0.0, period: float = 0.1
) -> list[Pest | None]:
    return [made.add(frame, (x, 0.0), index * period) for index, frame in enumerate(frames)]


def test_a_pest_is_reported_at_its_third_frame_in_a_row_and_once() -> None:
    frame = [red(), bug(confidence=0.5), bug(confidence=0.8)]
    found = reports(watch(), *[frame] * 5)
    assert found == [None, None, Pest("bug", 0.8), None, None]
    assert Pest("bug", 0.8).description == "bug seen where no tag is in sight (confidence 0.80)"


@pytest.mark.parametrize("gap", [[], [red()], [bug(confidence=0.3)]])
def test_a_frame_without_a_pest_begins_the_row_anew(gap: list[Detection]) -> None:
    assert reports(watch(), [bug()], [bug()], gap, [bug()], [bug()]) == [None] * 5


def test_frames_far_apart_are_in_no_row() -> None:
    """A detector on a robot is silent while it sees nothing (A27): three mistakes in an hour are no pest."""
    assert reports(watch(), *[[bug()]] * 5, period=anomalies.ROW_S + 0.1) == [None] * 5
    assert reports(watch(), *[[bug()]] * 3, period=anomalies.ROW_S)[-1] == Pest("bug", 0.9)


def test_a_tag_that_came_in_sight_begins_the_row_anew() -> None:
    made = watch()
    reports(made, [bug()], [bug()])
    made.interrupt()
    assert reports(made, *[[bug()]] * 3) == [None, None, Pest("bug", 0.9)]


def test_a_pest_that_is_just_sure_enough_counts() -> None:
    assert reports(watch(), *[[bug(confidence=0.35)]] * 3) == [None, None, Pest("bug", 0.35)]


def test_another_place_is_another_report_and_a_new_mission_too() -> None:
    made = watch()
    frames = [[bug()]] * 3
    assert reports(made, *frames)[-1] is not None
    assert reports(made, *frames, x=0.9) == [None] * 3
    assert reports(made, *frames, x=1.1)[0] is not None
    made.begin()
    assert reports(made, *frames)[-1] is not None
    made.begin([(0.2, 0.0)])
    assert reports(made, *frames) == [None] * 3, "reported before this process began"
    assert made.reported == [(0.2, 0.0)]


def test_a_new_mission_begins_the_row_anew() -> None:
    made = watch()
    reports(made, [bug()], [bug()])
    made.begin()
    assert reports(made, *[[bug()]] * 3) == [None, None, Pest("bug", 0.9)]


def test_a_pest_is_reported_only_once_the_robots_place_is_known() -> None:
    made = watch()
    assert [made.add([bug()], None, 0.0) for _ in range(4)] == [None] * 4
    assert made.add([bug()], (0.0, 0.0), 0.1) == Pest("bug", 0.9)


def test_there_is_an_end_to_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(anomalies, "MAX_REPORTS", 1)
    made = watch()
    assert reports(made, *[[bug()]] * 3)[-1] is not None
    assert reports(made, [bug()], x=50.0) == [None]
