"""What a mission can call on the base without ROS: functions, the reader of tags, mocks, battery, pose."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from lupin_engine.plugin.types import convert
from lupin_nav import goal_status, localization
from lupin_nav.battery import charge
from lupin_nav.catalog import PLUGIN
from tests.plugins.fakes import defaults

DOCK = {"x": 1.0, "y": 0.0, "yaw": 0.5}
#: Where a covariance of 6 x 6 has those of x, y and yaw, row by row.
X, Y, YAW = 0, 7, 35


def bound(name: str, **changed: Any) -> Any:
    return PLUGIN.functions[name].bind(defaults(PLUGIN, **changed))


def test_every_default_is_of_its_type() -> None:
    for name, parameter in PLUGIN.parameters.items():
        assert convert(parameter.default, parameter.type) == parameter.default, name


def test_what_functions_return_is_of_their_types() -> None:
    tags = bound("tags.numeric_order")()
    assert convert(tags, PLUGIN.functions["tags.numeric_order"].returns) == tags
    pose = bound("approach")(tags[0])
    assert convert(pose, PLUGIN.functions["approach"].returns) == pose


def test_loading_the_catalog_costs_neither_numpy_nor_ros() -> None:
    code = "import lupin_nav.catalog, sys; print([m for m in ('numpy', 'rclpy') if m in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


def test_approach_uses_standoff_and_file_of_the_parameters(tmp_path: Path) -> None:
    file = tmp_path / "overrides.yaml"
    file.write_text("overrides: {1: {yaw: 2.0}}")
    approach = bound("approach", approach_standoff_m=0.3, approach_overrides_file=str(file))
    tag = bound("tags.named")(["1"])[0]
    pose = approach(tag)
    assert pose["yaw"] == 2.0
    assert math.hypot(pose["x"] - tag["x"], pose["y"] - tag["y"]) == pytest.approx(0.3)


def test_the_tables_of_the_layout_count_where_its_tags_are_found_in_place() -> None:
    """War story 19: tag 26 faces the next table. Elsewhere the map is of another place."""
    approach = bound("approach_discovered", approach_standoff_m=0.5)
    tag = bound("tags.named")(["26"])[0]
    half, robot = math.sqrt(0.5), {"x": 0.0, "y": 0.0, "yaw": 0.0}
    along_y = {"x": -half, "y": 0.0, "z": 0.0, "w": half}
    stands = [approach({**tag, "y": tag["y"] + moved, "facing": along_y}, robot) for moved in (0.1, 0.2)]
    assert [stand["y"] - tag["y"] for stand in stands] == pytest.approx([0.3, 0.7])


def test_a_discovered_tag_is_approached_with_the_standoff_and_heading_of_the_parameters() -> None:
    approach = bound("approach_discovered", approach_standoff_m=0.3, approach_yaw=0.7)
    half, robot = math.sqrt(0.5), {"x": 2.0, "y": 4.0, "yaw": 0.0}
    along_x = {"x": 0.0, "y": half, "z": 0.0, "w": half}
    pose = approach({"x": 2.0, "y": 1.0, "facing": along_x}, robot)
    assert pose == pytest.approx({"x": 2.3, "y": 1.0, "yaw": math.pi})
    assert convert(pose, PLUGIN.functions["approach_discovered"].returns) == pose
    lying = {"x": 2.0, "y": 1.0, "facing": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    assert approach(lying, robot) == pytest.approx({"x": 2.0, "y": 1.3, "yaw": -math.pi / 2})
    assert approach(lying, {"x": 2.0, "y": 1.0, "yaw": 0.0}) == {"x": 2.0, "y": 1.0, "yaw": 0.7}


def test_a_distance_is_between_places_whatever_the_headings() -> None:
    distance = bound("distance")
    here, there = {"x": 1.0, "y": 2.0, "yaw": 0.0}, {"x": 4.0, "y": -2.0, "yaw": 3.0}
    assert distance(here, there) == distance(there, here) == 5.0
    assert distance(here, {**here, "yaw": 1.0}) == 0.0


def test_functions_read_the_layout_of_the_parameters(tmp_path: Path) -> None:
    file = tmp_path / "layout.json"
    file.write_text('{"tags": {"10": {"x": 1, "y": 2}, "9": {"x": 3, "y": 4}}}')
    tags = bound("tags.numeric_order", tag_locations_file=str(file))()
    assert tags == [{"id": "9", "x": 3.0, "y": 4.0}, {"id": "10", "x": 1.0, "y": 2.0}]
    assert bound("approach", tag_locations_file=str(file), approach_yaw=0.7)(tags[0]) == {
        "x": 3.0,
        "y": 4.0,
        "yaw": 0.7,
    }


def test_a_tag_is_approached_from_where_the_layout_says_that_its_plate_faces(tmp_path: Path) -> None:
    file = tmp_path / "layout.json"
    table = '"tables": {"T": {"x0": 0, "x1": 2, "y0": 0, "y1": 2}}'
    for facing, pose in (("+x", (2.5, 2.0, math.pi)), ("+y", (2.0, 2.5, -math.pi / 2))):
        file.write_text(f'{{"tags": {{"1": {{"x": 2, "y": 2, "facing": "{facing}"}}}}, {table}}}')
        changed = {"tag_locations_file": str(file)}
        found = bound("approach", **changed)(bound("tags.named", **changed)(["1"])[0])
        assert (found["x"], found["y"], abs(found["yaw"])) == pytest.approx((*pose[:2], abs(pose[2])))


def test_named_tags_keep_the_order_asked_for() -> None:
    assert [tag["id"] for tag in bound("tags.named")(["12", "3"])] == ["12", "3"]


def test_named_tags_report_every_unknown_id_at_once() -> None:
    with pytest.raises(ValueError, match=r"unknown tag '8', '99'; the layout has 29 tags: 1, 2, 3,"):
        bound("tags.named")(["1", "8", "99"])


def test_the_reader_turns_an_id_into_a_tag() -> None:
    read = PLUGIN.readers["tag"].bind(defaults(PLUGIN))
    assert read("1") == {"id": "1", "x": 1.6, "y": 1.3}


@pytest.mark.parametrize("value", ["99", "", 1, None, ["1"], {"id": "1"}])
def test_the_reader_refuses_what_is_no_id_of_the_layout(value: Any) -> None:
    reader = PLUGIN.readers["tag"]
    with pytest.raises(ValueError, match=r"unknown tag .*; the layout has 29 tags: 1, 2,"):
        reader.bind(defaults(PLUGIN))(value)
    assert reader.code.name == "unknown_tag"


def test_home_is_the_dock_or_the_start_when_the_dock_is_unset() -> None:
    start = {"x": 3.0, "y": 4.0, "yaw": 1.0}
    for dock in (DOCK, {"x": 0.0, "y": 1.0, "yaw": 0.5}):
        assert bound("home_pose", dock_pose=dock)(start) == dock
    assert bound("home_pose", dock_pose={"x": 0.0, "y": 0.0, "yaw": 0.5})(start) == {
        "x": 3.0,
        "y": 4.0,
        "yaw": 0.5,
    }


@pytest.mark.parametrize(
    ("reading", "fraction"),
    [(0.35, 0.35), (35.0, 0.35), (100.0, 1.0), (250.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.5, 0.015)],
)
def test_charge_is_a_fraction_whatever_the_scale(reading: float, fraction: float) -> None:
    assert charge(reading) == pytest.approx(fraction)


@pytest.mark.parametrize("reading", [math.nan, math.inf, -math.inf, -1.0])
def test_a_charge_that_says_nothing_is_ignored(reading: float) -> None:
    assert charge(reading) is None


@pytest.mark.parametrize(
    ("status", "code", "detail"),
    [
        (6, "nav_status_6", "ABORTED, error 204: no path"),
        (5, "nav_status_5", "CANCELED, error 204: no path"),
        (0, "nav_status_0", "UNKNOWN, error 204: no path"),
        (2, "nav_status_0", "EXECUTING, error 204: no path"),
        (7, "nav_status_0", "status 7, error 204: no path"),
        (-1, "nav_status_0", "status -1, error 204: no path"),
    ],
)
def test_a_failed_drive_is_told_by_name_and_with_a_declared_code(status: int, code: str, detail: str) -> None:
    said = goal_status.failure(status, SimpleNamespace(error_code=204, error_msg="no path"))
    assert said == (code, detail)
    assert code in {declared.name for declared in PLUGIN.operations["dock"].codes}


def test_a_server_without_error_fields_is_understood() -> None:
    assert goal_status.failure(6, SimpleNamespace()) == ("nav_status_6", "ABORTED")


def covariance(**at: float) -> list[float]:
    """Return a row-major 6 x 6 covariance with values at `v0` ... `v35`, else huge."""
    values = [1e6] * 36
    for index in (X, Y, YAW):
        values[index] = at.get(f"v{index}", 0.0)
    return values


@pytest.mark.parametrize("index", [X, Y, YAW])
def test_the_variance_is_the_largest_of_x_y_and_yaw_only(index: int) -> None:
    assert localization.variance(covariance(**{f"v{index}": 0.4})) == 0.4


def test_a_list_of_places_grows_by_one_and_not_for_ever() -> None:
    add = PLUGIN.functions["add_place"].bind({})
    places: list[Any] = []
    for number in range(20):
        before = list(places)
        longer = add(places, {"x": float(number), "y": 0.0, "yaw": 0.0})
        assert places == before, "the list of a mission's memory is not changed in place"
        places = longer
    assert [place["x"] for place in places] == [float(number) for number in range(4, 20)]


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
@pytest.mark.parametrize("index", [X, Y, YAW])
def test_a_variance_that_is_no_number_never_passes(index: int, value: float) -> None:
    worst = localization.variance(covariance(**{f"v{index}": value}))
    fix = localization.Fix(0.0, 0.0, 0.0, worst)
    assert localization.drift(fix, True, 0.25) == "amcl_drift_var=inf"
    assert localization.waits_for(fix, True, 0.25, "/amcl_pose") == "variance inf > 0.25"


def test_the_variance_at_the_limit_passes() -> None:
    fix = localization.Fix(0.0, 0.0, 0.0, 0.25)
    assert localization.drift(fix, True, 0.25) == ""
    assert localization.waits_for(fix, True, 0.25, "/amcl_pose") == ""


def test_without_a_limit_any_pose_will_do_but_one_must_be() -> None:
    assert localization.drift(localization.Fix(0.0, 0.0, 0.0, 9.0), False, None) == ""
    assert localization.drift(None, True, None) == "amcl_drift_var=unknown"


def test_mocks_end_and_return_what_is_declared() -> None:
    for name, operation in PLUGIN.operations.items():
        assert operation.mock.after > 0.0, name
        assert set(operation.mock.result) == set(operation.result), name
