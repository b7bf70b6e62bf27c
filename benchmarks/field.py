"""How long a sensor field of 200 x 100 cells takes, worked out and remembered, without ROS.

    .venv/bin/python benchmarks/field.py [--samples 22 29 1000 100000] [--rounds 20]

Beside it, where scipy is installed, the same field by way of its cKDTree: the nearest sample and those within
the falloff are asked of the tree, and weighted by numpy, a row of cells at a time. Both must have the same
values. Shown are the median and the fastest round, in milliseconds; a method that takes more than a second is
run twice, and the second counted. "One changed" is the field kept up to date when one sample of it has
another value each time. "Remembered" is the answer to a request that came before; "as a message", where there
is a ROS, with the response of GetField made from it.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from lupin_twin.field import DEFAULTS, FieldGrid, Floats, Interpolation, interpolate
from lupin_twin.heatmap import Heatmap, Heatmaps, Request
from lupin_twin.records import Pin, Reading
from lupin_twin.state import Twin

#: Metres; cells of 0.1 m make 200 x 100 of it.
WIDTH, HEIGHT, RESOLUTION = 20.0, 10.0, 0.1


def samples_of(count: int) -> tuple[Floats, Floats]:
    """Return places all over the floor, and values; the same ones every time."""
    numbers = np.random.default_rng(count)
    return numbers.random((count, 2)) * (WIDTH, HEIGHT), 15.0 + 10.0 * numbers.random(count)


def ours(positions: Floats, values: Floats) -> Floats:
    """Return the field by the twin's own method."""
    return interpolate(FieldGrid.over(0.0, 0.0, WIDTH, HEIGHT, RESOLUTION), positions, values).values


def one_changed(positions: Floats, values: Floats) -> Callable[[], object]:
    """Return what keeps a field up to date of which one sample, in its middle, changes with every call."""
    followed = Interpolation(FieldGrid.over(0.0, 0.0, WIDTH, HEIGHT, RESOLUTION))
    followed.update(positions, values)
    middle = int(np.argmin(np.hypot(*(positions - (WIDTH / 2, HEIGHT / 2)).T)))
    changing = values.copy()

    def change() -> object:
        changing[middle] += 0.125
        return followed.update(positions, changing)

    return change


def by_tree(positions: Floats, values: Floats) -> Floats:
    """Return the field by way of scipy's cKDTree, which is built anew, as new samples would need."""
    from scipy.spatial import cKDTree

    tree, grid = cKDTree(positions), FieldGrid.over(0.0, 0.0, WIDTH, HEIGHT, RESOLUTION)
    cells = np.full((grid.height, grid.width), np.nan)
    for row, y in enumerate(grid.y):
        centres = np.column_stack((grid.x, np.full(grid.width, y)))
        distance, nearest = tree.query(centres)
        found = tree.query_ball_point(centres, DEFAULTS.falloff, return_sorted=False)
        lengths = np.fromiter(map(len, found), dtype=np.intp, count=len(found))
        owner, near = np.repeat(np.arange(grid.width), lengths), np.concatenate(found).astype(np.intp)
        squared = np.square(positions[near] - centres[owner]).sum(axis=1)
        weight = 1.0 / np.maximum(squared, 1e-6)
        total = np.bincount(owner, weight * values[near], grid.width)
        mixed = total / np.maximum(np.bincount(owner, weight, grid.width), 1e-300)
        mixed = np.where(distance < 1e-3, values[nearest], mixed)
        cells[row] = np.where(distance <= DEFAULTS.max_distance, mixed, np.nan)
    return cells


def remembered(positions: Floats, values: Floats) -> Callable[[], Heatmap]:
    """Return what answers a request, which is worked out for the first time only."""
    twin = Twin()
    for number, ((x, y), value) in enumerate(zip(positions.tolist(), values.tolist(), strict=True)):
        twin.apply(Reading(str(number), 0.0, "", "", (("co2", value),), Pin(x, y, 0.0, 1.0)), 0.0)
    heatmaps, request = Heatmaps(twin), Request("co2", RESOLUTION, 0.0, 0.0, WIDTH, HEIGHT)
    return lambda: heatmaps.answer(request)


def as_message(answer: Callable[[], Heatmap]) -> Callable[[], object]:
    """Return `answer` with the response of the service made from it."""
    from lupin_msgs.srv import GetField
    from lupin_twin.node import fill

    return lambda: fill(GetField.Response(), answer())


def measure(name: str, rounds: int, work: Callable[[], object]) -> None:
    """Print how long `work` takes; the first round, which may import and remember, is not counted."""
    taken: list[float] = []
    for _ in range(rounds + 1):
        begun = time.perf_counter()
        work()
        taken.append(1e3 * (time.perf_counter() - begun))
        if len(taken) >= 2 and taken[0] > 1e3:
            break
    counted = taken[1:]
    print(f"{name:42} {statistics.median(counted):10.3f} ms   (fastest {min(counted):.3f})", flush=True)


def main() -> None:
    """Measure every count of samples."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--samples", type=int, nargs="+", default=[22, 29, 1000, 100_000])
    parser.add_argument("--rounds", type=int, default=20)
    given = parser.parse_args()
    for count in given.samples:
        positions, values = samples_of(count)
        measure(f"{count} samples", given.rounds, lambda p=positions, v=values: ours(p, v))
        measure(f"{count} samples, one changed", given.rounds, one_changed(positions, values))
        answer = remembered(positions, values)
        measure(f"{count} samples, remembered", given.rounds, answer)
        if find_spec("rclpy") is not None:
            measure(f"{count} samples, remembered, as a message", given.rounds, as_message(answer))
        if find_spec("scipy") is None:
            print(f"{count} samples, cKDTree: scipy is not installed")
            continue
        np.testing.assert_allclose(by_tree(positions, values), ours(positions, values), rtol=1e-9)
        measure(f"{count} samples, cKDTree", given.rounds, lambda p=positions, v=values: by_tree(p, v))


if __name__ == "__main__":
    main()
