"""The interpolated field: its grid, its formula and its limits, by examples and by properties."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from lupin_twin.field import (
    BadGrid,
    FieldGrid,
    Floats,
    Interpolation,
    InterpolationSettings,
    OccupancyMap,
    SensorField,
    interpolate,
)
from tests.benchmarking import started

DEFAULT = InterpolationSettings()


def field_of(
    grid: FieldGrid, *samples: tuple[float, float, float], settings: InterpolationSettings = DEFAULT
) -> SensorField:
    """Interpolate samples given as (x, y, value)."""
    table = np.array(samples, dtype=float).reshape(-1, 3)
    return interpolate(grid, table[:, :2], table[:, 2], settings)


def row(minimum: float, count: int, resolution: float = 1.0) -> FieldGrid:
    """Return one row of cells whose first centre is at (`minimum`, 0)."""
    return FieldGrid(minimum - resolution / 2, -resolution / 2, resolution, count, 1)


# --- the grid --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "resolution", "shape"),
    [
        ((2.0, 1.0), 0.5, (4, 2)),
        ((2.3, 2.3), 1.0, (3, 3)),
        ((0.0, 0.0), 1.0, (1, 1)),
        ((0.2, 5.0), 1.0, (1, 5)),
    ],
)
def test_the_grid_covers_the_rectangle(
    size: tuple[float, float], resolution: float, shape: tuple[int, int]
) -> None:
    grid = FieldGrid.over(-1.0, 3.0, -1.0 + size[0], 3.0 + size[1], resolution)
    assert (grid.width, grid.height) == shape
    assert (grid.min_x, grid.min_y, grid.resolution) == (-1.0, 3.0, resolution)


def test_cells_are_known_by_their_centres() -> None:
    grid = FieldGrid.over(0.0, 10.0, 2.0, 11.0, 0.5)
    assert_allclose(grid.x, [0.25, 0.75, 1.25, 1.75])
    assert_allclose(grid.y, [10.25, 10.75])


def test_bounds_that_went_through_32_bits_make_no_cell_more() -> None:
    wire = [float(np.float32(number)) for number in (0.0, 0.0, 20.1, 10.1, 0.1)]
    grid = FieldGrid.over(*wire)
    assert (grid.width, grid.height) == (201, 101)


@pytest.mark.parametrize(
    ("request_", "problem"),
    [
        ((0, 0, 1, 1, 0), "the resolution must be above 0 m, got 0"),
        ((0, 0, 1, 1, -0.5), "the resolution must be above 0 m, got -0.5"),
        ((0, 0, 1, 1, math.nan), "the resolution must be above 0 m, got nan"),
        ((0, 0, 1, 1, math.inf), "the resolution must be above 0 m, got inf"),
        ((2, 0, 1, 1, 0.1), "the bounds of x are the wrong way round: 2 to 1"),
        ((0, 5, 1, 1, 0.1), "the bounds of y are the wrong way round: 5 to 1"),
        ((0, 0, math.nan, 1, 0.1), "the bounds must be finite, got x 0 to nan, y 0 to 1"),
        ((-math.inf, 0, 1, 1, 0.1), "the bounds must be finite, got x -inf to 1, y 0 to 1"),
    ],
)
def test_a_grid_that_makes_no_sense_is_refused(request_: tuple[float, ...], problem: str) -> None:
    with pytest.raises(BadGrid) as refusal:
        FieldGrid.over(*request_)
    assert str(refusal.value) == problem


def test_the_smallest_cells_on_the_largest_floor_are_a_number_too() -> None:
    assert FieldGrid.over(0.0, 0.0, 3e38, 1.0, 1e-300).width >= 10**299


# --- the field -------------------------------------------------------------------------------------


def test_without_samples_nothing_is_known() -> None:
    field = field_of(row(0.0, 3))
    assert np.isnan(field.values).all()
    assert (field.minimum, field.maximum, field.sample_count) == (0.0, 0.0, 0)


def test_one_sample_makes_a_disc() -> None:
    field = field_of(FieldGrid(-2.5, -2.5, 1.0, 5, 5), (0.0, 0.0, 21.5))
    dx, dy = np.meshgrid(field.grid.x, field.grid.y)
    assert_array_equal(np.isnan(field.values), np.hypot(dx, dy) > 2.0)
    assert set(field.values[np.isfinite(field.values)]) == {21.5}
    assert np.isnan(field.values[0, 0])
    assert np.isnan(field.values[4, 4])
    assert (field.minimum, field.maximum, field.sample_count) == (21.5, 21.5, 1)


def test_a_sample_in_the_centre_of_a_cell_is_exact() -> None:
    field = field_of(row(0.0, 4), (1.0, 0.0, 19.7), (3.0, 0.0, 30.0))
    assert field.values[0, 1] == 19.7
    assert field.values[0, 3] == 30.0


def test_within_a_millimetre_the_nearest_sample_counts_alone() -> None:
    field = field_of(row(0.0, 1), (0.0009, 0.0, 10.0), (0.0008, 0.0, 20.0), (0.5, 0.0, 99.0))
    assert field.values[0, 0] == 20.0
    just_outside = field_of(row(0.0, 1), (0.0011, 0.0, 10.0), (0.0011, 0.0, 20.0))
    assert just_outside.values[0, 0] == pytest.approx(15.0)


def test_halfway_between_two_samples_is_their_mean() -> None:
    assert field_of(row(0.0, 1), (-1.0, 0.0, 10.0), (1.0, 0.0, 20.0)).values[0, 0] == pytest.approx(15.0)


@pytest.mark.parametrize(("power", "expected"), [(1.0, 12.5), (2.0, 11.0), (3.0, 10.0 + 10.0 / 28.0)])
def test_the_nearer_sample_weighs_more_by_the_power(power: float, expected: float) -> None:
    settings = InterpolationSettings(power=power, falloff=5.0, max_distance=5.0)
    field = field_of(row(0.0, 1), (-1.0, 0.0, 10.0), (3.0, 0.0, 20.0), settings=settings)
    assert field.values[0, 0] == pytest.approx(expected)


def test_a_near_sample_dominates() -> None:
    settings = InterpolationSettings(falloff=1.5, max_distance=1.5)
    # 0.2 m and 1.25 m away: the weights are 25 and 0.64.
    field = field_of(row(0.0, 1), (0.2, 0.0, 10.0), (-1.25, 0.0, 20.0), settings=settings)
    assert field.values[0, 0] == pytest.approx(10.0 + 6.4 / 25.64)
    assert field.values[0, 0] == pytest.approx(10.249, abs=1e-3)


def test_what_is_exactly_at_a_limit_is_within() -> None:
    field = field_of(row(0.0, 1), (2.0, 0.0, 10.0), (-1.0, 0.0, 20.0))
    assert field.values[0, 0] == pytest.approx((10.0 / 4 + 20.0) / (1 / 4 + 1))
    assert field_of(row(0.0, 1), (2.0, 0.0, 7.0)).values[0, 0] == 7.0
    assert np.isnan(field_of(row(0.0, 1), (2.0001, 0.0, 7.0)).values[0, 0])


def test_beyond_the_falloff_the_nearest_sample_has_a_ring() -> None:
    settings = InterpolationSettings(falloff=1.0, max_distance=3.0)
    field = field_of(row(0.0, 6), (-0.5, 0.0, 10.0), (8.0, 0.0, 90.0), settings=settings)
    assert_array_equal(field.values[0], [10.0, 10.0, 10.0, np.nan, np.nan, 90.0])


def test_of_two_that_are_equally_near_the_lesser_by_its_place_is_the_nearest() -> None:
    settings = InterpolationSettings(falloff=0.5, max_distance=3.0)
    field = field_of(row(0.0, 1), (1.0, 0.0, 20.0), (-1.0, 0.0, 10.0), settings=settings)
    assert field.values[0, 0] == 10.0


def test_the_falloff_may_reach_beyond_the_gate() -> None:
    settings = InterpolationSettings(falloff=5.0, max_distance=1.0)
    field = field_of(row(0.0, 1), (1.0, 0.0, 10.0), (-3.0, 0.0, 20.0), settings=settings)
    assert field.values[0, 0] == pytest.approx(11.0)
    assert np.isnan(field_of(row(0.0, 1), (3.0, 0.0, 1.0), settings=settings).values[0, 0])


def test_samples_far_from_everything_are_counted_and_show_nothing() -> None:
    field = field_of(row(0.0, 3), *[(50.0, float(k), 5.0) for k in range(3)])
    assert np.isnan(field.values).all()
    assert (field.minimum, field.maximum, field.sample_count) == (0.0, 0.0, 3)


def test_the_extremes_ignore_cells_without_a_value() -> None:
    field = field_of(row(0.0, 20), (1.0, 0.0, -4.0), (3.0, 0.0, 8.0))
    assert np.isnan(field.values).any()
    assert (field.minimum, field.maximum) == (-4.0, 8.0)


def test_where_nobody_has_looked_there_is_no_value() -> None:
    mask = np.array([[False, True, False]])
    field = interpolate(row(0.0, 3), np.array([[1.0, 0.0]]), np.array([5.0]), explored=mask)
    assert_array_equal(field.values, [[np.nan, 5.0, np.nan]])
    assert (field.minimum, field.maximum) == (5.0, 5.0)


def test_a_mask_of_another_size_is_refused() -> None:
    with pytest.raises(BadGrid, match=r"^the mask has shape \(1, 2\), the grid \(1, 3\)$"):
        interpolate(row(0.0, 3), np.empty((0, 2)), np.empty(0), explored=np.ones((1, 2), dtype=bool))


def test_a_field_cannot_be_changed() -> None:
    field = field_of(row(0.0, 3), (1.0, 0.0, 5.0))
    with pytest.raises(ValueError, match="read-only"):
        field.values[0, 0] = 1.0


# --- properties ------------------------------------------------------------------------------------

places = st.floats(-3.0, 8.0, allow_subnormal=False)
samples_strategy = st.lists(st.tuples(places, places, st.floats(-1e6, 1e6)), min_size=1, max_size=12)
settings_strategy = st.builds(
    InterpolationSettings,
    power=st.floats(0.5, 6.0),
    falloff=st.floats(0.0, 6.0),
    max_distance=st.floats(0.0, 6.0),
)
GRID = FieldGrid.over(0.0, 0.0, 5.0, 4.0, 0.5)


def plain_formula(grid: FieldGrid, samples: Floats, settings: InterpolationSettings) -> Floats:
    """Return the field cell by cell, as the formula is written."""
    cells = np.full((grid.height, grid.width), np.nan)
    for j, y in enumerate(grid.y):
        for i, x in enumerate(grid.x):
            distances = np.hypot(samples[:, 0] - x, samples[:, 1] - y)
            near = distances <= settings.falloff
            if distances.min() > settings.max_distance:
                continue
            if distances.min() < 1e-3 or not near.any():
                cells[j, i] = samples[np.argmin(distances), 2]
            else:
                weights = distances[near] ** -settings.power
                cells[j, i] = (weights * samples[near, 2]).sum() / weights.sum()
    return cells


def test_it_is_the_formula_cell_by_cell() -> None:
    numbers = np.random.default_rng(7)
    for power, falloff, gate in ((2.0, 2.0, 2.0), (3.0, 1.0, 2.5), (1.5, 4.0, 0.7), (2.0, 50.0, 50.0)):
        settings = InterpolationSettings(power, falloff, gate)
        samples = numbers.random((40, 3)) * (12.0, 9.0, 30.0) - (2.0, 2.0, 0.0)
        field = interpolate(GRID, samples[:, :2], samples[:, 2], settings)
        assert_allclose(field.values, plain_formula(GRID, samples, settings), rtol=1e-12)


@given(samples=samples_strategy, settings=settings_strategy)
def test_no_value_leaves_the_range_of_the_samples(
    samples: list[tuple[float, float, float]], settings: InterpolationSettings
) -> None:
    values = field_of(GRID, *samples, settings=settings).values
    known = values[np.isfinite(values)]
    assert not np.isinf(values).any()
    assert (known >= min(s[2] for s in samples)).all()
    assert (known <= max(s[2] for s in samples)).all()


@given(samples=samples_strategy, settings=settings_strategy, order=st.randoms(use_true_random=False))
def test_the_order_of_the_samples_changes_nothing(
    samples: list[tuple[float, float, float]], settings: InterpolationSettings, order: random.Random
) -> None:
    shuffled = list(samples)
    order.shuffle(shuffled)
    before, after = (field_of(GRID, *some, settings=settings) for some in (samples, shuffled))
    assert_array_equal(before.values, after.values)


#: On a fine raster, sums are exact, so that no sample crosses a limit by rounding.
raster = st.integers(-512, 512).map(lambda number: number / 64.0)


@given(
    samples=st.lists(st.tuples(raster, raster, st.floats(-1e6, 1e6)), min_size=1, max_size=12),
    shift=st.tuples(raster, raster),
)
def test_moving_everything_moves_the_field(
    samples: list[tuple[float, float, float]], shift: tuple[float, float]
) -> None:
    dx, dy = shift
    moved_grid = FieldGrid(GRID.min_x + dx, GRID.min_y + dy, GRID.resolution, GRID.width, GRID.height)
    moved = field_of(moved_grid, *((x + dx, y + dy, v) for x, y, v in samples))
    assert_array_equal(moved.values, field_of(GRID, *samples).values)


# --- the map ---------------------------------------------------------------------------------------


def test_the_map_tells_what_is_explored() -> None:
    cells = np.array([[0, -1, 100], [-1, 0, 0]], dtype=np.int8)
    known = OccupancyMap(10.0, 20.0, 0.0, 1.0, cells).explored(FieldGrid(9.0, 20.0, 1.0, 5, 3))
    expected = [[False, True, False, True, False], [False, False, True, True, False], [False] * 5]
    assert known.tolist() == expected


def test_the_map_may_be_turned_and_have_other_cells() -> None:
    # Turned by 90°: the map's columns run along +y, its rows along -x.
    cells = np.array([[0, 0], [-1, 0]], dtype=np.int8)
    known = OccupancyMap(0.0, 0.0, math.pi / 2, 2.0, cells).explored(FieldGrid(-4.0, 0.0, 2.0, 2, 2))
    assert known.tolist() == [[False, True], [True, True]]


# --- the benchmark -----------------------------------------------------------------------------------


def test_the_benchmark_measures_ours() -> None:
    shown = started("field.py", "--samples", "3", "5", "--rounds", "2")
    times = dict(re.findall(r"^(\d samples(?:, remembered)?) +([0-9.]+) ms", shown.stdout, re.MULTILINE))
    assert list(times) == ["3 samples", "3 samples, remembered", "5 samples", "5 samples, remembered"]
    assert all(float(taken) > 0.0 for taken in times.values())
    assert float(times["5 samples, remembered"]) < float(times["5 samples"])


# --- kept up to date --------------------------------------------------------------------------------


places = st.floats(-3.0, 13.0)
some_samples = st.lists(st.tuples(places, places, st.sampled_from([1.0, 2.5, -7.0])), max_size=12)


@given(st.lists(some_samples, min_size=2, max_size=4), st.data())
def test_an_updated_field_is_the_same_as_a_new_one(
    changes: list[list[tuple[float, float, float]]], data: st.DataObject
) -> None:
    grid, settings = FieldGrid.over(0.0, 0.0, 10.0, 8.0, 0.4), InterpolationSettings(2.0, 1.5, 2.0)
    followed = Interpolation(grid, settings)
    for index, samples in enumerate(changes):
        if index:  # what most changes are like: all stay but a few
            samples = [*data.draw(st.permutations(changes[index - 1])), *samples[:2]]
        table = np.array(samples, dtype=float).reshape(-1, 3)
        found = followed.update(table[:, :2], table[:, 2])
        new = field_of(grid, *samples, settings=settings)
        assert_array_equal(found.values, new.values)
        assert (found.minimum, found.maximum, found.sample_count) == (new.minimum, new.maximum, len(samples))


def test_an_update_touches_only_what_the_change_reaches(monkeypatch: pytest.MonkeyPatch) -> None:
    grid, sizes = FieldGrid.over(0.0, 0.0, 20.0, 10.0, 0.1), []
    followed, real = Interpolation(grid), Interpolation._weighted

    def watched(self: Interpolation, x: Floats, y: Floats, *more: Floats) -> Floats:
        sizes.append((len(x), len(y)))
        return real(self, x, y, *more)

    monkeypatch.setattr(Interpolation, "_weighted", watched)
    places = np.array([[2.0, 5.0], [10.0, 5.0], [18.0, 5.0], [99.0, 99.0]])
    for values in ([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0], [1.0, 2.5, 3.0, 4.0], [1.0, 2.5, 3.0, 5.0]):
        followed.update(places, np.array(values))
    assert sizes == [(200, 40), (40, 40)]
