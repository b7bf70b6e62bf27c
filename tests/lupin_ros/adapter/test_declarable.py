"""What the checker accepts as a parameter, a node can declare; the orchestrator does nothing else with it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lupin_engine.missions.folders import is_mission, lifecycle_of
from lupin_engine.missions.load import inspect_chart
from lupin_engine.plugin.parameters import RESERVED, carried_as
from lupin_engine.plugin.types import MAX_INTEGER, TEXT, Type
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.parameters import _ROS_OWN
from lupin_ros.orchestrator.missions import OWN_PARAMETERS
from tests import shipped

ROOT = Path(__file__).parents[3]
MINI = ROOT / "tests" / "charts" / "mini" / "lifecycle.yaml"
#: Missions of the repository; some stand in pages and are no whole ones.
MISSIONS = sorted(
    path
    for folder in ("missions", "examples", "docs", "tests/charts/good", "tests/charts/mini")
    for path in (ROOT / folder).rglob("*.yaml")
    if is_mission(path)
)

#: A value for each kind of type, as files write it.
NUMBERS = st.one_of(st.integers(-MAX_INTEGER - 2, MAX_INTEGER + 2), st.floats(allow_nan=False))
VALUES = {
    "any": st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=5)),
    "bool": st.booleans(),
    "number": NUMBERS,
    "text": st.text(max_size=5),
    "integer": st.integers(-MAX_INTEGER - 2, MAX_INTEGER + 2),
    "count": st.integers(0, 5),
    "duration": st.sampled_from(["5 s", "-1 s", "2 min", "1e9 h"]),
    "length": st.sampled_from(["5 cm", "-0.5 m"]),
    "angle": st.sampled_from(["90 deg", "-1 rad"]),
    "time_of_day": st.just("06:30"),
    "date": st.just("2026-11-22"),
    "pose": st.just({"x": "1 m", "y": "0 m", "yaw": "0 rad"}),
    "tag": st.just({"id": "1"}),
    "ward": st.sampled_from([{"id": "a", "door": "1 m"}, {"id": "a", "door": "1 cm"}, {"id": "a"}]),
}


@st.composite
def parameters(draw: st.DrawFn) -> dict[str, Any]:
    """Return the declaration of a parameter: many are right."""
    kind = draw(st.sampled_from(sorted(VALUES)))
    default: st.SearchStrategy[Any] = VALUES[kind]
    for _ in range(draw(st.sampled_from([0, 0, 1, 1, 2]))):
        kind, default = f"{draw(st.sampled_from(['list', 'set']))} of {kind}", st.lists(default, max_size=2)
    declared = {"type": kind, "default": draw(default)}
    for bound in ("min", "max"):
        if draw(st.integers(0, 3)) == 0:
            declared[bound] = draw(NUMBERS)
    return declared


NAMES = st.sampled_from(["a", "b", "c_", "d__", "e1"]) | st.sampled_from(sorted(RESERVED))


@pytest.fixture(scope="module")
def node() -> Iterator[RosNode]:
    """A node with the parameters that every orchestrator has."""
    with RosNode("declaring", parameters=OWN_PARAMETERS) as node:
        yield node


def declare(node: RosNode, lifecycle: Path, mission: Path) -> bool:
    """Declare the parameters of a mission as the orchestrator does; tell whether it was accepted."""
    chart = inspect_chart(lifecycle, [mission], shipped.catalog()).chart
    if chart is not None:
        node.declare_anew({**OWN_PARAMETERS, **chart.parameters})
        values = node.parameters()
        assert {name: values[name] for name in chart.parameters} == {
            name: spec.default for name, spec in chart.parameters.items()
        }
    return chart is not None


def test_names_that_are_taken_are_known_without_ros() -> None:
    """The checker cannot ask the node: it runs where there is no ROS."""
    assert {*OWN_PARAMETERS, *_ROS_OWN} == RESERVED


def test_the_parameters_of_every_mission_can_be_declared(node: RosNode) -> None:
    accepted = [mission for mission in MISSIONS if declare(node, lifecycle_of(mission), mission)]
    assert len(accepted) > 30


@given(st.dictionaries(NAMES, parameters(), min_size=1, max_size=2))
@settings(max_examples=300)
def test_what_is_accepted_can_be_declared(
    node: RosNode, tmp_path_factory: pytest.TempPathFactory, params: dict[str, dict[str, Any]]
) -> None:
    mission = tmp_path_factory.getbasetemp() / "declared.yaml"
    states = "initial: A\nstates: {A: {after: {5 s: done}}, done: {type: final}}\n"
    types = "types: {ward: {id: text, door: {type: length, min: 50 cm}}}"
    mission.write_text(
        f"mission: Declared\n{types}\nparams: {json.dumps(params)}\n{states}", encoding="utf-8"
    )
    if declare(node, MINI, mission):
        known = {**shipped.catalog().known_types, "ward": Type("record", "ward", fields={"id": TEXT})}
        assert all(carried_as(known[p["type"].rpartition(" of ")[2]]) for p in params.values())
        assert RESERVED.isdisjoint(params)
