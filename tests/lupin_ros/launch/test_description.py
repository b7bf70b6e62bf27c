"""Which nodes are started, and with what."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from lupin_engine.errors import LupinError, PluginError
from lupin_engine.plugin.contract import Operation, Plugin
from lupin_engine.plugin.registry import Catalog, build_catalog, load_catalog
from lupin_ros.launch.description import (
    COMPOSED,
    NodeLaunch,
    PresentEndpoints,
    command,
    composed,
    describe_launch,
    parameter_file,
)
from lupin_ros.launch.nodes import LaunchableNode

CATALOG: Catalog = build_catalog(
    [
        Plugin("drive", "Driving.", operations={"go": Operation("Go.")}),
        Plugin("read", "Reading.", operations={"scan": Operation("Scan.")}, nodes={"reader": "r:main"}),
        Plugin("other", "Not used.", operations={"op": Operation("Op.")}, nodes={"unused": "o:main"}),
        Plugin("twin", "Watches.", nodes={"twin": "t:main"}, companions=("twin",)),
        Plugin(
            "fake",
            "A robot.",
            nodes={"fake_robot": "f:main"},
            stands_in={"fake_robot": ("navigate",)},
            simulated_defaults={"dwell_s": 0.5, "unheard_of": 1.0},
        ),
        Plugin(
            "hand",
            "An arm.",
            client="h:Client",
            nodes={"hand": "h:main", "fake_hand": "h:fake"},
            stands_in={"fake_hand": ("grip",)},
        ),
    ]
)
REAL_ROBOT = ("reader", "twin", "mission_orchestrator")
EVERYTHING = ("fake_robot", "reader", "twin", "mission_orchestrator")


NOTHING = PresentEndpoints()


def plan(
    present: PresentEndpoints = NOTHING, simulate: bool = True
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    found = describe_launch(["drive", "read"], CATALOG, present, {}, simulate=simulate)
    return found.starts, found.joined


def test_an_empty_network_needs_everything_that_is_used() -> None:
    """The simulated robot first, the orchestrator last; nodes of plugins that nobody uses stay out."""
    assert plan() == (EVERYTHING, ())


def test_what_missions_do_not_use_is_not_simulated() -> None:
    """An arm only for missions that move it; the robot itself is part of them all."""
    assert "fake_hand" not in plan()[0]
    with_the_arm = describe_launch(["drive", "hand"], CATALOG, PresentEndpoints(), {})
    assert with_the_arm.starts == ("fake_robot", "fake_hand", "twin", "hand", "mission_orchestrator")


def test_what_looks_after_a_robot_is_started_beside_a_real_and_a_simulated_one() -> None:
    guarded = replace(CATALOG.plugins["drive"], nodes={"guard": "g:main"}, guards={"guard": ("navigate",)})
    catalog = build_catalog([guarded, CATALOG.plugins["fake"]])
    there = PresentEndpoints(actions=frozenset({"/navigate"}))
    simulated = describe_launch(["drive"], catalog, NOTHING, {}).starts
    assert simulated == ("fake_robot", "guard", "mission_orchestrator")
    for present, simulate in ((there, True), (there, False), (NOTHING, False)):
        found = describe_launch(["drive"], catalog, present, {}, simulate=simulate)
        assert found.starts == ("guard", "mission_orchestrator")


def test_robots_and_companions_of_another_profile_stay_out() -> None:
    others = [replace(CATALOG.plugins[name], profile="forest") for name in ("fake", "twin")]
    catalog = build_catalog([*others, CATALOG.plugins["read"], CATALOG.plugins["drive"]])
    found = describe_launch(["drive", "read"], catalog, NOTHING, {})
    assert found.starts == ("reader", "mission_orchestrator")


@pytest.mark.parametrize(
    ("present", "starts", "joined"),
    [
        (
            PresentEndpoints(nodes=frozenset({"reader"})),
            ("fake_robot", "twin", "mission_orchestrator"),
            ("reader",),
        ),
        (
            PresentEndpoints(actions=frozenset({"/navigate"})),
            ("reader", "twin", "mission_orchestrator"),
            ("navigate",),
        ),
        (
            PresentEndpoints(services=frozenset({"/navigate"})),
            ("reader", "twin", "mission_orchestrator"),
            ("navigate",),
        ),
        (PresentEndpoints(actions=frozenset({"/robot/navigate"})), EVERYTHING, ()),
        (PresentEndpoints(nodes=frozenset(EVERYTHING)), (), EVERYTHING),
    ],
    ids=["a node", "a real robot", "a service", "another robot's action", "all"],
)
def test_what_is_there_is_used(
    present: PresentEndpoints, starts: tuple[str, ...], joined: tuple[str, ...]
) -> None:
    """A node by its name, a simulated robot by what it stands in for."""
    assert plan(present) == (starts, joined)


def test_no_robot_is_simulated_when_that_is_not_wanted() -> None:
    """`--no-sim` waits for the real one."""
    assert plan(simulate=False) == (REAL_ROBOT, ())


@pytest.mark.parametrize(
    ("present", "simulate", "given", "expected"),
    [
        (PresentEndpoints(), True, {}, {"dwell_s": 0.5}),
        (PresentEndpoints(), True, {"dwell_s": 3.0, "other": 1}, {"dwell_s": 3.0, "other": 1}),
        (PresentEndpoints(actions=frozenset({"/navigate"})), True, {}, {}),
        (PresentEndpoints(), False, {}, {}),
    ],
    ids=["simulated", "said otherwise", "a real robot", "not simulated"],
)
def test_a_simulation_has_defaults_of_its_own_for_missions(
    present: PresentEndpoints, simulate: bool, given: dict[str, object], expected: dict[str, object]
) -> None:
    """Only where it is started, only what the missions have, and never against what is said."""
    parameters = {"mission_orchestrator": given} if given else {}
    found = describe_launch(
        ["drive"], CATALOG, present, parameters, simulate=simulate, known=["dwell_s", "other"]
    )
    assert dict(found.launches[-1].parameters) == expected


def test_parameters_reach_their_node(tmp_path: Path) -> None:
    """As a file, because arguments carry neither lists nor the difference between 5 and '5'."""
    launch = NodeLaunch(LaunchableNode("reader", "r:main", "read"), {"tags": ["1", "5"]})
    line = command([launch], tmp_path)
    assert line[-6:] == ["lupin_cli.main", "node", "reader", "--ros-args", "--params-file", line[-1]]
    assert Path(line[-1]).read_text() == 'reader:\n  ros__parameters:\n    tags: ["1", "5"]\n'
    assert command([NodeLaunch(launch.node)], tmp_path)[-2:] == ["node", "reader"]
    pump = NodeLaunch(LaunchableNode("pump", "p:main", "water"), {"high": 1})
    files = [arg for name in ("reader", "pump") for arg in ("--params-file", str(tmp_path / f"{name}.yaml"))]
    assert command([launch, pump], tmp_path)[4:] == ["reader", "pump", "--ros-args", *files]


def test_values_keep_their_type_in_the_file() -> None:
    """Numbers as numbers, text quoted, a pose as the list of its fields, other records as JSON."""
    values = {"a": 60.0, "b": "60", "c": True, "d": {"x": 1.0, "y": 2.0, "yaw": 0.0}, "e": 3}
    values |= {"f": {"n": 1}, "g": [[{"x": 1.0}]], "h": []}
    assert parameter_file("n", values).splitlines() == [
        "n:",
        "  ros__parameters:",
        "    a: 60.0",
        '    b: "60"',
        "    c: true",
        "    d: [1.0, 2.0, 0.0]",
        "    e: 3",
        r'''    f: "{\"n\": 1}"''',
        r'''    g: "[[{\"x\": 1.0}]]"''',
        "    h: []",
    ]


def test_what_a_node_checks_is_told_and_its_defects_are_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module may check its parameters together; one without a check takes whatever fits its types."""

    def check(values: Mapping[str, int]) -> None:
        if values["low"] > values["high"]:
            raise LupinError("low is above high")

    module = ModuleType("pump")
    monkeypatch.setitem(sys.modules, "pump", module)
    node = LaunchableNode("pump", "pump:main", "water")
    node.check({"low": 5, "high": 1})
    module.check = check  # type: ignore[attr-defined]
    node.check({"low": 1, "high": 5})
    with pytest.raises(LupinError, match=r"^low is above high$"):
        node.check({"low": 5, "high": 1})
    with pytest.raises(
        PluginError, match=r"^node 'pump' of plugin 'water': its check failed: KeyError: 'high'$"
    ):
        node.check({"low": 5})


@pytest.mark.parametrize(
    ("wanted", "simulate", "is_composed"),
    [(None, True, True), (None, False, False), (True, False, True), (False, True, False)],
)
def test_nodes_share_a_process_where_the_robot_is_simulated_or_somebody_wants_it(
    wanted: bool | None, simulate: bool, is_composed: bool
) -> None:
    """Of the shipped ones all do but those that keep the robot safe: each of these is alone, always."""
    shipped = load_catalog()
    starts = describe_launch(shipped.plugins, shipped, NOTHING, {}, simulate=simulate)
    processes = composed(starts, shipped, wanted).processes
    together = {launch.node.name for launch in processes.get(COMPOSED, ())}
    alone = {"mission_orchestrator", "nav_watchdog", "lupin_gateway"}
    assert together == (set(starts.starts) - alone if is_composed else set())
    assert all(len(processes[name]) == 1 for name in alone)
    assert list(processes)[-1] == "mission_orchestrator"


def test_the_watchdog_of_navigation_is_started_beside_the_simulated_base() -> None:
    shipped = load_catalog()
    starts = describe_launch(["nav"], shipped, NOTHING, {}).starts
    assert {"lupin_sim", "nav_watchdog"} <= set(starts)
