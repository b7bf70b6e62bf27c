"""The mission of the cookbook with a table of places, over real ROS 2."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters

from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine_msgs.srv import Command
from lupin_ros.service.names import COMMAND_SERVICE
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

COOKBOOK = Path(__file__).parents[4] / "docs" / "cookbook"
NODE = "mission_orchestrator"
FORM = "[{id: text, floor: integer, pose: {x: m, y: m, yaw: rad}, door: m}, ...]"


def ward(name: str, **fields: Any) -> dict[str, Any]:
    """A ward that can be delivered to, except as `fields` say."""
    return {"id": name, "floor": 1, "pose": {"x": 1, "y": 0.5, "yaw": 0}, "door": 1.2, **fields}


def setting(operator: Operator, value: Any) -> str:
    """Set the table of wards, and return why not."""
    text = value if isinstance(value, str) else json.dumps(value)
    given = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=text)
    request = SetParameters.Request(parameters=[RosParameter(name="wards", value=given)])
    (result,) = operator.call(SetParameters, f"/{NODE}/set_parameters", request).results
    return "" if result.successful else str(result.reason)


def table(operator: Operator) -> list[str]:
    """The names of the wards that the orchestrator goes by."""
    request = GetParameters.Request(names=["wards"])
    (value,) = operator.call(GetParameters, f"/{NODE}/get_parameters", request).values
    return [each["id"] for each in json.loads(value.string_value)]


def test_a_table_of_wards(world: World, operator: Operator, tmp_path: Path) -> None:
    """What is wrong in it is refused and changes nothing; a request has wards with their fields."""
    missions = shutil.copytree(COOKBOOK / "parts", tmp_path / "missions" / "parts").parent
    shutil.copy(COOKBOOK / "wards.yaml", missions)
    shutil.copy(default_missions_folder() / LIFECYCLE, missions)
    world.start_all(missions_path=missions, wards=json.dumps(json.dumps([ward("lab"), ward("icu")])))
    operator.in_state("READY")
    assert table(operator) == ["lab", "icu"]
    described = DescribeParameters.Request(names=["wards"])
    (told,) = operator.call(DescribeParameters, f"/{NODE}/describe_parameters", described).descriptors
    assert told.description == f"the places of this hospital [JSON, numbers in base units: {FORM}]"

    begin = "parameter 'wards': [0]"
    hint = f"; give it as JSON: {FORM}"
    assert setting(operator, [ward("a", dor=1)]) == (
        f"{begin}.dor: a ward has no 'dor'; did you mean 'door'?{hint}"
    )
    assert setting(operator, [ward("a", door="20 cm")]).startswith(
        f"{begin}.door: expected length between 50 and 300 cm, got '20 cm'"
    )
    assert setting(operator, "{") == f"parameter 'wards': unfinished: it ends after '{{'{hint}"
    assert setting(operator, []) == f"parameter 'wards': expected at least 1 element, got 0{hint}"
    assert setting(operator, '[{"id": "a", "id": "b"}]') == (
        f"parameter 'wards': a record has 'id' twice; leave one out{hint}"
    )
    assert setting(operator, [ward("a", flor=1), {**ward("b"), "id": 7}]).splitlines() == [
        f"{begin}.flor: a ward has no 'flor'; did you mean 'floor'?",
        f"parameter 'wards': [1].id: expected text, got 7{hint}",
    ]
    assert table(operator) == ["lab", "icu"]
    assert operator.state.lifecycle_state == "READY"
    assert setting(operator, [ward("store", door="60 cm"), ward("icu")]) == ""

    asked = Command.Request(verb="start", mission="Wards")
    asked.request = json.dumps({"deliver_to": [ward("lab", floor="1")]})
    refused = operator.call(Command, COMMAND_SERVICE, asked)
    assert (refused.accepted, refused.code) == (False, "bad_request")
    assert refused.message == "deliver_to[0].floor: expected integer, got '1'"
    asked.request = '{"deliver_to": [], "deliver_to": []}'
    assert operator.call(Command, COMMAND_SERVICE, asked).message == (
        "start refused: its request is no JSON: a record has 'deliver_to' twice; leave one out"
    )
    assert operator.state.lifecycle_state == "READY"

    assert operator.start(mission="Wards").accepted  # to all of the table
    operator.until_done(published=2)
    told_of = [(one.tag_reading.tag_id, one.status) for one in operator.observations]
    assert told_of == [("store", 3), ("icu", 0)]
    asked.request = json.dumps({"deliver_to": [ward("lab")]})
    assert operator.call(Command, COMMAND_SERVICE, asked).accepted
    operator.until_done(published=3)
    assert operator.observations[-1].tag_reading.tag_id == "lab"
