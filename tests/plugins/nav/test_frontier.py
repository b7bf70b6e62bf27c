"""Which frontier is driven to: the reference robot's cases, and properties over random maps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from lupin_nav.frontier import Frontier, OccupancyGrid, Survey, Thresholds, make_grid, survey

U, F, X = -1, 0, 100
#: Every frontier counts, however small and narrow.
ANY = Thresholds(min_cells=1, radius_cells=0)


def drawn(picture: str) -> np.ndarray[Any, Any]:
    """Read a map: space unknown, `.` free, `#` occupied; the first line is the top, as maps are drawn."""
    lines = [line.strip().strip("|") for line in picture.strip().splitlines()]
    return np.array([[{" ": U, ".": F, "#": X}[c] for c in line] for line in reversed(lines)], dtype=np.int8)


def choose(
    data: Any,
    width: int,
    height: int,
    resolution: float,
    origin: Sequence[float] = (0.0, 0.0),
    robot: tuple[float, float] | None = None,
    thresholds: Thresholds | None = None,
) -> Frontier | None:
    """Return the best frontier of row-major `data`; None when there is none, or no grid."""
    grid = make_grid(data, width, height, resolution, origin)
    return None if grid is None else survey(grid, robot, thresholds).frontier


def best(
    cells: Any,
    thresholds: Thresholds = ANY,
    robot: tuple[float, float] | None = None,
    resolution: float = 1.0,
    origin: tuple[float, ...] = (0.0, 0.0),
) -> Frontier | None:
    grid = np.asarray(cells, dtype=np.int8)
    height, width = grid.shape
    return choose(grid.reshape(-1), width, height, resolution, origin, robot, thresholds)


def island() -> np.ndarray[Any, Any]:
    """3 x 3 free cells in the unknown."""
    cells = np.full((5, 5), U, dtype=np.int8)
    cells[1:4, 1:4] = F
    return cells


TWO_SIDES = drawn("""
|  ...........  |
|  ...........  |
|  ...........  |
""")


# --- the reference's cases


def test_an_island_has_one_frontier_of_its_eight_outer_cells() -> None:
    found = best(island())
    assert found is not None
    assert (found.cells, found.clusters) == (8, 1)


@pytest.mark.parametrize("value", [U, F])
def test_without_free_or_without_unknown_cells_there_is_none(value: int) -> None:
    assert best(np.full((5, 5), value)) is None


def test_a_cluster_of_too_few_cells_is_noise() -> None:
    cells = np.full((3, 3), U)
    cells[1, 1] = F
    assert best(cells, Thresholds(min_cells=2, radius_cells=0)) is None
    found = best(cells, Thresholds(min_cells=1, radius_cells=0))
    assert found == Frontier(1.5, 1.5, 1, 1)


def test_a_cell_beside_an_obstacle_needs_a_clearance_of_none() -> None:
    cells = drawn("""
    | .#|
    """)
    assert best(cells, Thresholds(min_cells=1, radius_cells=1)) is None
    assert best(cells, Thresholds(min_cells=1, radius_cells=0)) is not None


@pytest.mark.parametrize(("robot", "side"), [((2.5, 1.5), 2.5), ((12.5, 1.5), 12.5)])
def test_the_robot_takes_the_frontier_on_its_own_side(robot: tuple[float, float], side: float) -> None:
    found = best(TWO_SIDES, robot=robot)
    assert found is not None
    assert (found.x, found.y) == (side, 1.5)


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 0},
        {"height": 0},
        {"width": -3},
        {"resolution": 0.0},
        {"resolution": -0.05},
        {"resolution": math.nan},
        {"data": [0] * 8},
        {"data": []},
        {"origin": (math.inf, 0.0)},
    ],
)
def test_what_is_no_grid_has_no_frontier(wrong: dict[str, Any]) -> None:
    right: dict[str, Any] = {
        "data": [-1, 0, 0] * 3,
        "width": 3,
        "height": 3,
        "resolution": 1.0,
        "thresholds": ANY,
    }
    assert choose(**right) is not None
    assert choose(**{**right, **wrong}) is None
    told = {name: value for name, value in {**right, **wrong}.items() if name != "thresholds"}
    assert make_grid(**told) is None


def corridor(free: int) -> np.ndarray[Any, Any]:
    """A wall on the left, `free` free columns, then the unknown."""
    row = [X, *[F] * free, U]
    return np.array([row] * 40, dtype=np.int8)


@pytest.mark.parametrize(
    ("thresholds", "free", "kept"),
    [
        # The frontier column is `free` cells from the wall; 5 cells of 0.05 m are 0.25 m.
        (Thresholds(min_cells=1, radius_cells=4), 5, True),
        (Thresholds(min_cells=1, clearance=0.35), 5, False),
        (Thresholds(min_cells=1, clearance=0.35), 7, False),
        (Thresholds(min_cells=1, clearance=0.35), 8, True),
        (Thresholds(min_cells=1, clearance=0.35, radius_cells=0), 1, True),
    ],
)
def test_clearance_is_in_metres_unless_cells_are_given(thresholds: Thresholds, free: int, kept: bool) -> None:
    found = best(corridor(free), thresholds, resolution=0.05)
    assert (found is not None) == kept


@pytest.mark.parametrize(
    ("clearance", "resolution", "cells"),
    [(0.35, 0.05, 7), (0.35, 0.5, 1), (0.0, 0.05, 0), (0.36, 0.05, 8), (0.3, float(np.float32(0.02)), 15)],
)
def test_the_radius_is_the_clearance_in_whole_cells(clearance: float, resolution: float, cells: int) -> None:
    assert Thresholds(clearance=clearance).radius(resolution) == cells


def test_a_clearance_of_more_cells_than_any_grid_has_is_all_of_it() -> None:
    """A map whose resolution is told in other units, or not at all."""
    cells = corridor(8)
    grid = make_grid(cells.ravel(), cells.shape[1], cells.shape[0], 1e-30)
    assert grid is not None
    result = survey(grid, None, Thresholds(min_cells=1))
    assert (result.frontier, result.cramped) == (None, len(cells))


@pytest.mark.parametrize(("threshold", "found"), [(65, True), (50, False)])
def test_half_occupied_cells_block_only_from_the_threshold_of_the_clearance_on(
    threshold: int, found: bool
) -> None:
    cells = [[-1, 0, 50]]
    limits = Thresholds(min_cells=1, radius_cells=1, clearance_occupied=threshold)
    assert (best(cells, limits) is not None) == found


# --- the choice


def test_free_ends_at_its_threshold() -> None:
    assert best([[-1, 20]], Thresholds(min_cells=1, radius_cells=0)) is not None
    assert best([[-1, 21]], Thresholds(min_cells=1, radius_cells=0)) is None


def test_corners_join_a_cluster_and_do_not_make_a_frontier() -> None:
    # The free cells touch at a corner only: one frontier of two.
    assert best([[-1, 0], [0, -1]]) == Frontier(1.5, 0.5, 2, 1)
    # Unknown only across the corner: no frontier.
    cells = np.full((3, 3), F)
    cells[0, 0] = U
    found = best(cells)
    assert found is not None
    assert found.cells == 2


def test_a_large_frontier_far_away_wins_by_size_over_one_plus_distance() -> None:
    cells = drawn("""
    |.                   .|
    |                    .|
    |                    .|
    """)
    # Alone: 3 cells before 1. From beside the small one: 1 / (1 + 0) before 3 / (1 + 20).
    alone, near = best(cells), best(cells, robot=(0.5, 2.5))
    assert alone is not None
    assert near is not None
    assert (alone.cells, near.cells, near.clusters) == (3, 1, 2)
    # At a distance of 2 the small one scores 1/3, at 18 the large one 3/19.
    assert best(cells, robot=(2.5, 2.5)) == near
    # In the middle the larger one wins.
    assert best(cells, robot=(10.5, 2.5)) == alone


def test_of_equal_frontiers_the_first_row_by_row_wins() -> None:
    cells = np.full((3, 7), U)
    cells[0, 5] = cells[2, 1] = F
    assert best(cells) == Frontier(5.5, 0.5, 1, 2)
    assert best(cells, robot=(3.5, 1.5)) == Frontier(5.5, 0.5, 1, 2)


def test_the_goal_is_the_member_nearest_to_the_centroid() -> None:
    cells = drawn("""
    |...|
    |.  |
    |.  |
    |.  |
    |.  |
    |...|
    """)
    found = best(cells)
    # The centroid of the bracket lies in its unknown middle; a goal there would not be free.
    assert found == Frontier(0.5, 2.5, 8, 1)


def test_a_turned_grid_is_turned_back() -> None:
    cells = np.full((1, 4), U)
    cells[0, 2] = F
    found = best(cells, origin=(10.0, 20.0, math.pi / 2))
    assert found is not None
    assert (found.x, found.y) == pytest.approx((9.5, 22.5))


@given(x=st.floats(-20.0, 20.0), y=st.floats(-20.0, 20.0), yaw=st.floats(-4.0, 4.0))
def test_turning_and_moving_a_grid_turns_and_moves_its_goal(x: float, y: float, yaw: float) -> None:
    cells = np.full((3, 4), U)
    cells[1, 2] = F
    found = best(cells, resolution=0.4, origin=(x, y, yaw))
    assert found is not None
    right, up, cosine, sine = 1.0, 0.6, math.cos(yaw), math.sin(yaw)
    assert (found.x - x, found.y - y) == pytest.approx(
        (cosine * right - sine * up, sine * right + cosine * up), abs=1e-9
    )


def test_a_survey_counts_what_did_not_count() -> None:
    cells = drawn("""
    |.   .#   ..........|
    """)
    cells[0, 12] = 40  # neither free nor solid
    grid = make_grid(cells, 19, 1, 1.0)
    assert grid is not None
    found = survey(grid, None, Thresholds(min_cells=2, radius_cells=1))
    assert found == Survey(frontier=None, known=13, undecided=1, cramped=1, small=2, avoided=0)


TWO_ROOMS = """
    |...............     ......|
    """


@pytest.mark.parametrize(
    ("avoid", "chosen", "avoided"),
    [
        ([], 7.5, 0),
        ([(7.5, 0.5)], 22.5, 1),
        ([(7.5, 2.4)], 22.5, 1),
        ([(7.5, 2.6)], 7.5, 0),
        ([(3.0, 0.5)], 7.5, 0),
        ([(22.5, 0.5)], 7.5, 1),
    ],
)
def test_a_frontier_near_a_place_to_avoid_is_not_chosen(
    avoid: list[tuple[float, float]], chosen: float, avoided: int
) -> None:
    """Near is measured from its middle, where the robot would drive: a long one is not avoided by one end."""
    cells = drawn(TWO_ROOMS)
    cells = np.vstack([np.full_like(cells, U), cells])
    grid = make_grid(cells, cells.shape[1], 2, 1.0, (0.0, -1.0))
    assert grid is not None
    result = survey(grid, (7.5, 0.5), Thresholds(min_cells=3, radius_cells=0, avoid_distance=2.0), avoid)
    assert result.frontier is not None
    assert (result.frontier.x, result.frontier.clusters, result.avoided) == (chosen, 2 - avoided, avoided)


def test_where_every_frontier_is_avoided_there_is_none() -> None:
    grid = make_grid(drawn("|... |"), 4, 1, 1.0)
    assert grid is not None
    limits = Thresholds(min_cells=1, radius_cells=0)
    result = survey(grid, None, limits, [(2.5, 0.5)])
    assert (result.frontier, result.avoided) == (None, 1)
    assert survey(grid, None, limits, [(2.5, 1.1)]).frontier is not None


# --- properties


@st.composite
def maps(draw: st.DrawFn) -> OccupancyGrid:
    """A grid of a few rooms, some noise and obstacles."""
    shape = draw(st.tuples(st.integers(1, 24), st.integers(1, 24)))
    cells = draw(arrays.arrays(np.int8, shape, elements=st.sampled_from([U, U, F, F, F, 30, 70, X])))
    return OccupancyGrid(cells, draw(st.sampled_from([0.05, 0.1, 0.5, 1.0])))


limits = st.builds(
    Thresholds, min_cells=st.integers(1, 5), radius_cells=st.integers(-1, 3), clearance=st.floats(0.0, 0.4)
)
places = st.tuples(st.floats(-5.0, 30.0), st.floats(-5.0, 30.0))
robots = st.none() | places


def cell_of(grid: OccupancyGrid, found: Frontier) -> tuple[int, int]:
    return math.floor((found.y - grid.y) / grid.resolution), math.floor((found.x - grid.x) / grid.resolution)


def around(grid: OccupancyGrid, row: int, column: int, radius: int) -> np.ndarray[Any, Any]:
    top, left = max(0, row - radius), max(0, column - radius)
    return grid.cells[top : row + radius + 1, left : column + radius + 1]


@given(grid=maps(), thresholds=limits, robot=robots)
def test_the_goal_is_a_free_cell_beside_the_unknown_with_clearance(
    grid: OccupancyGrid, thresholds: Thresholds, robot: tuple[float, float] | None
) -> None:
    found = survey(grid, robot, thresholds).frontier
    if found is None:
        return
    row, column = cell_of(grid, found)
    height, width = grid.cells.shape
    beside = [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
    assert 0 <= grid.cells[row, column] <= thresholds.free
    assert any(grid.cells[r, c] == U for r, c in beside if 0 <= r < height and 0 <= c < width)
    square = around(grid, row, column, thresholds.radius(grid.resolution))
    assert (square < thresholds.clearance_occupied).all()
    assert found.cells >= thresholds.min_cells
    assert found.clusters >= 1


def plain_clusters(grid: OccupancyGrid, thresholds: Thresholds) -> Iterator[list[tuple[int, int]]]:
    """Find the clusters one cell after the other, as one would without arrays."""
    height, width = grid.cells.shape
    radius = thresholds.radius(grid.resolution)

    def is_frontier(row: int, column: int) -> bool:
        if not 0 <= grid.cells[row, column] <= thresholds.free:
            return False
        steps = ((1, 0), (-1, 0), (0, 1), (0, -1))
        near = [(row + r, column + c) for r, c in steps if 0 <= row + r < height and 0 <= column + c < width]
        if not any(grid.cells[r, c] == U for r, c in near):
            return False
        return bool((around(grid, row, column, radius) < thresholds.clearance_occupied).all())

    left = {(r, c) for r in range(height) for c in range(width) if is_frontier(r, c)}
    while left:
        todo, cluster = [min(left)], []
        left.discard(todo[0])
        while todo:
            row, column = todo.pop()
            cluster.append((row, column))
            touching = {(row + r, column + c) for r in (-1, 0, 1) for c in (-1, 0, 1)} & left
            left -= touching
            todo.extend(touching)
        yield sorted(cluster)


@given(grid=maps(), thresholds=limits, robot=robots)
def test_arrays_choose_what_a_plain_search_chooses(
    grid: OccupancyGrid, thresholds: Thresholds, robot: tuple[float, float] | None
) -> None:
    clusters = list(plain_clusters(grid, thresholds))
    large = [cluster for cluster in clusters if len(cluster) >= thresholds.min_cells]
    result = survey(grid, robot, thresholds)
    assert result.small == len(clusters) - len(large)
    if not large:
        assert result.frontier is None
        return
    assert result.frontier is not None
    assert result.frontier.clusters == len(large)

    def score(cluster: list[tuple[int, int]]) -> float:
        size, down, right = len(cluster), sum(r for r, _ in cluster), sum(c for _, c in cluster)
        row, column = min(cluster, key=lambda m: ((m[0] * size - down) ** 2 + (m[1] * size - right) ** 2, m))
        x, y = (column + 0.5) * grid.resolution, (row + 0.5) * grid.resolution
        return len(cluster) / (1.0 if robot is None else 1.0 + math.hypot(x - robot[0], y - robot[1]))

    (chosen,) = [cluster for cluster in large if cell_of(grid, result.frontier) in cluster]
    assert result.frontier.cells == len(chosen)
    # Which of two equals is the first may hang on rounding; that it is one of the best may not.
    assert score(chosen) == pytest.approx(max(map(score, large)))


@given(grid=maps(), thresholds=limits, x=st.integers(-50, 50), y=st.integers(-50, 50))
def test_moving_the_origin_moves_the_goal(
    grid: OccupancyGrid, thresholds: Thresholds, x: int, y: int
) -> None:
    # Without a robot: its distances are rounded, and of two equals another one may then be the best.
    here = survey(grid, None, thresholds).frontier
    there = survey(OccupancyGrid(grid.cells, grid.resolution, float(x), float(y)), None, thresholds).frontier
    assert (here is None) == (there is None)
    if here is not None and there is not None:
        assert (there.x - x, there.y - y) == pytest.approx((here.x, here.y))


@given(grid=maps(), robot=robots)
def test_more_clearance_never_finds_more(grid: OccupancyGrid, robot: tuple[float, float] | None) -> None:
    found = [survey(grid, robot, Thresholds(min_cells=1, radius_cells=r)) for r in range(4)]
    cramped = [result.cramped for result in found]
    assert cramped == sorted(cramped)
    open_first = [result.frontier is not None for result in found]
    assert open_first == sorted(open_first, reverse=True)


@given(grid=maps(), robot=robots)
def test_avoiding_what_was_chosen_finds_all_frontiers_one_after_the_other(
    grid: OccupancyGrid, robot: tuple[float, float] | None
) -> None:
    """Each once, the best first; then there is none, and as many are avoided as there were."""
    limits = Thresholds(min_cells=1, radius_cells=0, avoid_distance=0.0)
    first = survey(grid, robot, limits)
    avoid: list[tuple[float, float]] = []
    result = first
    while result.frontier is not None:
        avoid.append((result.frontier.x, result.frontier.y))
        result = survey(grid, robot, limits, avoid)
        assert result.avoided == len(avoid)
    assert len(set(avoid)) == len(avoid) == (first.frontier.clusters if first.frontier else 0)


@given(grid=maps(), thresholds=limits, robot=robots)
def test_nothing_is_written_into_the_map(
    grid: OccupancyGrid, thresholds: Thresholds, robot: tuple[float, float] | None
) -> None:
    before = grid.cells.copy()
    grid.cells.setflags(write=False)
    first = survey(grid, robot, thresholds)
    assert survey(grid, robot, thresholds) == first
    assert np.array_equal(grid.cells, before)


@pytest.mark.parametrize("robot", [(10.5, 2.5), (110.5, -47.5)])
def test_moving_robot_and_origin_together_changes_nothing(robot: tuple[float, float]) -> None:
    cells = np.full((5, 21), U)
    cells[2, 0] = cells[1:4, 20] = F
    found = best(cells, robot=robot, origin=(robot[0] - 10.5, robot[1] - 2.5))
    assert found is not None
    assert (found.x - robot[0], found.y - robot[1], found.cells) == (10.0, 0.0, 3)
