"""Requests for a field: what is refused and why, and what is remembered."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from lupin_twin import heatmap
from lupin_twin.field import InterpolationSettings, OccupancyMap
from lupin_twin.heatmap import (
    FOLLOWED,
    MAX_CELLS,
    REMEMBERED,
    FieldRequestRefused,
    Heatmap,
    Heatmaps,
    Request,
)
from lupin_twin.records import Discovery, Pin, Reading
from lupin_twin.state import Twin

SENSORS = "'temperature', 'humidity', 'co2', 'light', 'soil_moisture'"


def request(**changed: Any) -> Request:
    area = {"min_x": 0.0, "min_y": 0.0, "max_x": 4.0, "max_y": 2.0}
    return Request(**{"sensor": "temperature", "resolution": 1.0, **area, **changed})


def cells(answer: Heatmap) -> Any:
    values = np.frombuffer(answer.values, dtype=np.float32)
    return values.reshape(answer.grid.height, answer.grid.width)


def reading(tag: str, x: float, value: float, stamp: float = 1.0) -> Reading:
    return Reading(tag, stamp, "", "", (("temperature", value),), Pin(x, 0.5, 0.0, 1.0))


@pytest.fixture
def state() -> Twin:
    """One tag at (0.5, 0.5) of 20 degrees."""
    state = Twin()
    state.apply(reading("1", 0.5, 20.0), 1.0)
    return state


@pytest.fixture
def worked_out(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one with every field that is worked out."""
    done: list[int] = []
    real = heatmap.Interpolation.update

    def counted(*arguments: Any) -> Any:
        done.append(1)
        return real(*arguments)

    monkeypatch.setattr(heatmap.Interpolation, "update", counted)
    return done


def test_a_field_is_sent_row_by_row(state: Twin) -> None:
    answer = Heatmaps(state).answer(request())
    expected = [[20.0, 20.0, 20.0, math.nan], [20.0, 20.0, math.nan, math.nan]]
    np.testing.assert_array_equal(cells(answer), expected)
    assert (answer.grid.width, answer.grid.height, answer.grid.min_x, answer.grid.resolution) == (4, 2, 0, 1)
    assert (answer.minimum, answer.maximum, answer.sample_count) == (20.0, 20.0, 1)


def test_a_known_sensor_without_readings_has_an_empty_field(state: Twin) -> None:
    answer = Heatmaps(state).answer(request(sensor=" co2 "))
    assert np.isnan(cells(answer)).all()
    assert (answer.minimum, answer.maximum, answer.sample_count) == (0.0, 0.0, 0)


def test_the_settings_are_used(state: Twin) -> None:
    answer = Heatmaps(state, InterpolationSettings(max_distance=0.1)).answer(request())
    assert np.isfinite(cells(answer)).sum() == 1


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"sensor": ""}, f"the sensor type is empty; allowed: {SENSORS}"),
        ({"sensor": " \n"}, f"the sensor type is empty; allowed: {SENSORS}"),
        ({"sensor": "temprature"}, "unknown sensor type 'temprature'; did you mean 'temperature'?"),
        ({"resolution": 0.0}, "the resolution must be above 0 m, got 0"),
        ({"resolution": math.nan}, "the resolution must be above 0 m, got nan"),
        ({"max_x": -1.0}, "the bounds of x are the wrong way round: 0 to -1"),
        ({"max_x": 0.0}, "the bounding box is empty: x from 0 to 0 m"),
        ({"min_y": 2.0}, "the bounding box is empty: y from 2 to 2 m"),
        ({"min_y": math.inf}, "the bounds must be finite, got x 0 to 4, y inf to 2"),
        (
            {"resolution": 1e-3},
            "4 m x 2 m at 0.001 m are more than 250000 cells; ask for a smaller area or a coarser resolution",
        ),
        (
            {"resolution": 1e-3, "min_x": 1.0, "min_y": -1.0},
            "3 m x 3 m at 0.001 m are more than 250000 cells; ask for a smaller area or a coarser resolution",
        ),
        (
            {"resolution": 1e-38, "max_x": 3e38},
            "3e+38 m x 2 m at 1e-38 m are more than 250000 cells; "
            "ask for a smaller area or a coarser resolution",
        ),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(state: Twin, changed: dict[str, Any], reason: str) -> None:
    with pytest.raises(FieldRequestRefused) as refusal:
        Heatmaps(state).answer(request(**changed))
    assert str(refusal.value) == reason


def test_an_endless_sensor_type_is_not_repeated_in_full(state: Twin) -> None:
    with pytest.raises(FieldRequestRefused) as refusal:
        Heatmaps(state).answer(request(sensor="x" * 1_000_000))
    assert str(refusal.value).startswith(f"unknown sensor type '{'x' * 40}...'; allowed: 'co2', ")
    assert len(str(refusal.value)) < 200


def test_the_largest_field_is_answered(state: Twin) -> None:
    answer = Heatmaps(state).answer(request(max_x=500.0, max_y=500.0))
    assert answer.grid.width * answer.grid.height == MAX_CELLS
    assert len(answer.values) == 1_000_000


def test_the_same_request_is_worked_out_once(state: Twin, worked_out: list[int]) -> None:
    heatmaps = Heatmaps(state)
    assert heatmaps.answer(request()) == heatmaps.answer(request())
    assert len(worked_out) == 1


@pytest.mark.parametrize("changed", [{"sensor": "co2"}, {"resolution": 0.5}, {"min_x": -1.0}, {"max_y": 3.0}])
def test_another_request_is_another_field(
    state: Twin, worked_out: list[int], changed: dict[str, Any]
) -> None:
    heatmaps = Heatmaps(state)
    assert heatmaps.answer(request()) != heatmaps.answer(request(**changed))
    assert len(worked_out) == 2


def test_an_observation_makes_the_field_another(state: Twin) -> None:
    heatmaps = Heatmaps(state)
    heatmaps.answer(request())
    state.apply(reading("1", 0.5, 25.0, stamp=2.0), 2.0)
    assert heatmaps.answer(request()).maximum == 25.0


def test_a_place_makes_the_field_another_without_an_observation(state: Twin) -> None:
    state.apply(Reading("2", 1.0, "", "", (("temperature", 30.0),)), 1.0)
    heatmaps = Heatmaps(state)
    assert heatmaps.answer(request()).maximum == 20.0
    state.apply(Discovery("2", Pin(3.5, 0.5, 0.0, 1.0)), 1.0)
    assert heatmaps.answer(request()).maximum == 30.0


def test_the_map_hides_what_nobody_has_seen(state: Twin) -> None:
    heatmaps = Heatmaps(state)
    heatmaps.answer(request())
    heatmaps.explore(OccupancyMap(0.0, 0.0, 0.0, 2.0, np.array([[0, -1]], dtype=np.int8)))
    expected = [[20.0, 20.0, math.nan, math.nan], [20.0, 20.0, math.nan, math.nan]]
    np.testing.assert_array_equal(cells(heatmaps.answer(request())), expected)


@pytest.mark.parametrize(
    ("x", "resolution", "far", "again"),
    [(0.0, 2.0, -1, 0), (0.1, 2.0, -1, 1), (0.0, 2.5, -1, 1), (0.0, 2.0, 0, 1)],
    ids=["the same", "moved", "finer", "grown"],
)
def test_only_another_map_makes_the_field_another(
    state: Twin, worked_out: list[int], x: float, resolution: float, far: int, again: int
) -> None:
    """Who makes maps tells the same one every few seconds."""
    heatmaps = Heatmaps(state)
    heatmaps.explore(OccupancyMap(0.0, 0.0, 0.0, 2.0, np.array([[0, -1]], dtype=np.int8)))
    heatmaps.answer(request())
    heatmaps.explore(OccupancyMap(x, 0.0, 0.0, resolution, np.array([[0, far]], dtype=np.int8)))
    heatmaps.answer(request())
    assert len(worked_out) == 1 + again


def test_what_was_not_asked_for_longest_is_forgotten(state: Twin, worked_out: list[int]) -> None:
    heatmaps = Heatmaps(state)
    areas = [request(max_x=float(n + 1)) for n in range(REMEMBERED + 1)]
    for area in (*areas[:REMEMBERED], areas[0], areas[REMEMBERED]):
        heatmaps.answer(area)
    assert len(worked_out) == REMEMBERED + 1
    heatmaps.answer(areas[0])
    assert len(worked_out) == REMEMBERED + 1
    heatmaps.answer(areas[1])
    assert len(worked_out) == REMEMBERED + 2


def test_fields_that_are_asked_for_again_are_kept_up_to_date(state: Twin) -> None:
    heatmaps = Heatmaps(state)
    requests = [request(min_x=-float(n)) for n in range(FOLLOWED + 1)]
    for one in requests:
        heatmaps.answer(one)
    assert list(heatmaps._followed) == requests[1:]
    state.apply(reading("1", 0.5, 25.0, stamp=2.0), 2.0)
    kept = heatmaps._followed[requests[1]]
    assert heatmaps.answer(requests[1]) == Heatmaps(state).answer(requests[1])
    assert heatmaps._followed[requests[1]] is kept
    assert list(heatmaps._followed)[-1] == requests[1]
    heatmaps.explore(OccupancyMap(0.0, 0.0, 0.0, 1.0, np.zeros((1, 1), np.int8)))
    assert heatmaps._followed == {}
