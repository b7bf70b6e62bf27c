"""One chart of any size for every peer, of the shape of the missions that benchmarks/loading.py generates.

Areas of groups of steps, one to three transitions a step, guards and actions among them. Ours has timers,
operations, holds and the shipped lifecycle beside that; a peer that lacks them is not charged for them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

STEPS_IN_GROUP = 10
GROUPS_IN_AREA = 9

#: The kinds of step: events, with whether each is guarded and whether it counts; and whether entering counts.
_STEPS: tuple[tuple[dict[str, tuple[bool, bool]], bool], ...] = (
    ({"succeeded": (False, False), "failed": (False, True)}, True),
    ({"elapsed": (False, False), "skip": (False, False)}, False),
    ({"checked": (True, False), "elapsed": (False, False)}, False),
    ({"visited": (False, False)}, True),
    ({"skip": (False, False), "elapsed": (False, False)}, False),
)


def write_trees(sizes: list[int], folder: Path) -> None:
    """Write the charts to `tree-N.json`, which each peer turns into its own language before it is timed."""
    for size in sizes:
        (folder / f"tree-{size}.json").write_text(json.dumps(tree(size)), encoding="utf-8")


def tree(states: int) -> list[dict[str, Any]]:
    """Return a chart of that many states: PREPARE, which `go` leaves for the first step, areas, and done."""
    areas = list(_areas(states - 2))
    found = [_state("PREPARE", {"go": (False, False)}, "AREA_1")]
    for number, groups in enumerate(areas, 1):
        leave = f"AREA_{number + 1}" if number < len(areas) else "done"
        names = [f"GROUP_{number}_{index + 1}" for index in range(len(groups))]
        children = [
            _group(name, steps, following)
            for name, steps, following in zip(names, groups, [*names[1:], leave], strict=True)
        ]
        found.append(_state(f"AREA_{number}", states=children))
    return [*found, _state("done")]


def _areas(states: int) -> Iterator[list[int]]:
    """Yield for each area how many steps its groups have; areas and groups are states themselves."""
    while states > 0:
        states -= 1
        groups: list[int] = []
        while states > 0 and len(groups) < GROUPS_IN_AREA:
            steps = max(1, min(STEPS_IN_GROUP, states - 1))
            groups.append(steps)
            states -= steps + 1
        yield groups


def _group(name: str, steps: int, following: str) -> dict[str, Any]:
    names = [f"{name}_STEP_{index + 1}" for index in range(steps)]
    children = []
    for index, (step, after) in enumerate(zip(names, [*names[1:], following], strict=True)):
        events, counts = _STEPS[index % len(_STEPS)]
        children.append({**_state(step, events, after), "counts": counts})
    return _state(name, states=children)


def _state(
    name: str,
    events: dict[str, tuple[bool, bool]] | None = None,
    target: str = "",
    states: list[dict[str, Any]] | None = None,
) -> dict[str, Any]:
    rules = [
        {"event": event, "target": target, "guarded": guarded, "counts": counts}
        for event, (guarded, counts) in (events or {}).items()
    ]
    return {"name": name, "states": states or [], "on": rules, "counts": False}
